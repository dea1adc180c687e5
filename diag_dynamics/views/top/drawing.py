# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Lines of text that show numbers: sparklines of blocks, charts of braille; of plain letters where there is no Unicode."""

import numpy as np

BLOCKS, LETTERS = " ▁▂▃▄▅▆▇█", " .:-=+*#@"

_DOTS = np.array([[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]])
"""Bits of a braille character's dots, from above, left and right."""


def sparkline(values, most, fancy=True):
    """A character for each value, from zero to `most`; blank where one is not known."""
    levels = BLOCKS if fancy else LETTERS
    if not most > 0.0:
        return "".join(" " if value != value else levels[1] for value in values)
    steps = np.clip(np.ceil(np.nan_to_num(values) / most * (len(levels) - 1)), 1, len(levels) - 1).astype(int)
    steps[np.isnan(values)] = 0
    return "".join([levels[step] for step in steps.tolist()])


def chart(values, most, height, fancy=True):
    """Lines of an area under values, from zero to `most`; two values to a character, or one of plain letters.

    Parameters
    ----------
    values : ndarray
        Twice as many as characters, or as many; NaN is blank.
    most : float
    height : int
        Lines.

    Returns
    -------
    list of str
        From above.
    """
    dots = 4 * height if fancy else height
    scale = dots / most if most > 0.0 else 0.0
    filled = np.where(np.isnan(values), 0, np.clip(np.ceil(np.nan_to_num(values) * scale), 1, dots)).astype(int)
    lit = np.arange(dots, 0, -1)[:, None] <= filled
    if not fancy:
        return ["".join("#" if one else " " for one in row) for row in lit.tolist()]
    cells = lit.reshape(height, 4, -1, 2)
    codes = 0x2800 + (cells * _DOTS[None, :, None, :]).sum(axis=(1, 3))
    return ["".join(map(chr, row)) for row in codes.tolist()]
