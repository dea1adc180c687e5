"""The switch between compiling fast and compiling plainly."""

import os

import numba

OLDEST = (0, 68)
"""The numba that the private parts were written for and tested with; an older one has other pass managers."""

PLAIN = os.environ.get("DIAG_DYNAMICS_PLAIN", "") not in ("", "0") or numba.version_info[:2] < OLDEST
"""Whether kernels are compiled by numba's documented interface alone: slower, for a numba that has changed inside."""
