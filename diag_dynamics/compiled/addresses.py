"""Arrays that a kernel is told of by one number, which costs less than an argument for each."""

import numba
import numpy as np

from diag_dynamics.compiled.arrays import array_at

bytes_at, words_at, indices_at, flags_at, vector_at = (
    array_at(kind, 1, lent=True) for kind in (numba.uint8, numba.int32, numba.int64, numba.boolean, numba.float64)
)
matrix_at, table_at = array_at(numba.float64, 2, lent=True), array_at(numba.int64, 2, lent=True)


_TYPES = (np.uint8, np.bool_, np.int64, np.float64)


class Addresses:
    """A table of whole numbers and of addresses of arrays, which lives as long as this.

    Parameters
    ----------
    *entries : int or ndarray
        In the order in which the kernel looks them up; arrays are C-contiguous, and of the kernel's types.

    Attributes
    ----------
    table : ndarray of int64
    at : int
        Its address.
    """

    def __init__(self, *entries):
        self._arrays = [entry for entry in entries if isinstance(entry, np.ndarray)]
        for array in self._arrays:
            if not (array.flags.c_contiguous and (array.dtype in _TYPES or array.dtype.fields)):
                raise ValueError(f"an array of {array.dtype} is of no kernel's type, or not C-contiguous")
        numbers = [entry.ctypes.data if isinstance(entry, np.ndarray) else entry for entry in entries]
        self.table = np.array(numbers, dtype=np.int64)
        self.at = self.table.ctypes.data
