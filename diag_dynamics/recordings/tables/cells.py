# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Cells of a table, arrays of pyarrow, as numbers, lists of numbers and texts."""

import numpy as np
import pyarrow as pa

from diag_dynamics.recordings.tables.joint_names import MAX_LENGTH, numbers_of
from diag_dynamics.recordings.tables.times import is_date

BLANK = ("", "NA", "N/A", "n/a", "#N/A", "null", "NULL", "None", "none", "-", "--")
"""Texts of empty cells; nan is a value that a driver has sent."""
MISSING = frozenset((*BLANK, "nan", "NaN", "NAN", "-nan", "-NaN"))
"""Texts that stand for no number."""
SAMPLE = 6
"""First rows that show what a column of texts holds."""


def is_text(kind):
    """Return whether a type of pyarrow is of texts."""
    kind = kind.value_type if pa.types.is_dictionary(kind) else kind
    return str(kind) in ("string", "large_string", "string_view", "binary", "large_binary", "binary_view")


def decoded(array):
    """Return an array without its dictionary."""
    return array.dictionary_decode() if pa.types.is_dictionary(array.type) else array


def to_numpy(array):
    """Return an array of numbers as doubles; null is NaN."""
    return decoded(array).cast(pa.float64(), safe=False).to_numpy(zero_copy_only=False)


def read_texts(array):
    """Return texts, or lists of them; empty of null, and of a text too long for a name, such as a picture."""
    return list(map(_text, array.to_pylist()))


def _text(value):
    if isinstance(value, list):
        return list(map(_text, value))
    text = value.decode(errors="replace") if isinstance(value, bytes) else value or ""
    return text if len(text) <= MAX_LENGTH else ""


def parse_number(text, decimal="."):
    """Return the number in a text, NaN of a sign of no value; None of any other text."""
    text = text.strip()
    if text in MISSING:
        return np.nan
    if decimal == ",":
        text = "" if "." in text else text.replace(",", ".")
    try:
        return None if "_" in text else float(text)
    except ValueError:
        return None


def sample_column(column, texts):
    """Return a column with what its first texts show: times or numbers, lists of numbers, or names."""
    texts = tuple(text.strip() for text in texts)
    given = [text for text in texts if text not in MISSING]
    if any(parse_number(text, ",") is not None or parse_number(text) is not None or is_date(text) for text in given):
        return column._replace(dated=True, moments=all(map(is_date, given)))
    lists = [numbers_of(text) for text in given]
    if any(lists) and None not in lists:
        return column._replace(width=max(map(len, lists)), listed=True, numeric=True)
    return column._replace(sample=texts, listed=bool(given) and all(text.endswith((")", "]")) for text in given))


def are_blank(array):
    """Return whether cells hold nothing, bool (n,): null, an empty list, or a text for it."""
    if is_text(array.type):
        return np.array([text.strip() in (*BLANK, "[]", "()") for text in read_texts(array)], bool)
    if hasattr(array, "value_lengths"):
        return array.value_lengths().fill_null(0).to_numpy(zero_copy_only=False) == 0
    return array.is_null().to_numpy(zero_copy_only=False)


def read_numbers(array, decimal, lose):
    """Return the numbers of a column, (n,), and report texts that are none by `lose(cause, unit, rows, example)`."""
    if not is_text(array.type):
        return to_numpy(array)
    try:
        if decimal == ".":
            return decoded(array).cast(pa.float64()).to_numpy(zero_copy_only=False)
    except pa.ArrowInvalid:
        pass
    texts = read_texts(array)
    numbers = [parse_number(text, decimal) for text in texts]
    if lost := [k for k, number in enumerate(numbers) if number is None]:
        lose("text where a number belongs", "fields are NaN", lost, f"'{texts[lost[0]].strip()[:40]}'")
    return np.array(numbers, float)


def read_lists(array, width, lose):
    """Return the numbers of a column of lists, or of texts of them, (n, k): NaN behind the end of a list.

    Lists of another length than `width` are NaN throughout, unless it is None; `lose` is that of :func:`read_numbers`.
    """
    if is_text(array.type):
        texts = read_texts(decoded(array))
        lists = [numbers_of(text) for text in texts]
        if lost := [k for k, one in enumerate(lists) if one is None and texts[k].strip() not in MISSING]:
            lose("text where a list of numbers belongs", "rows of it are NaN", lost, f"'{texts[lost[0]].strip()[:40]}'")
        array = pa.array(lists, pa.list_(pa.float64()))
    lengths = array.value_lengths().fill_null(0).to_numpy(zero_copy_only=False)
    filled = np.arange(lengths.max(initial=0)) < lengths[:, None]
    values = np.full(filled.shape, np.nan)
    values[filled] = to_numpy(array.flatten())
    if width is None:
        return values
    odd = np.flatnonzero((lengths != width) & (lengths > 0))
    if odd.size:
        example = f"{lengths[odd[0]]} instead of {width}"
        lose("list of another length than there are joints", "rows of it are NaN", odd, example)
    fitting = np.full((len(values), width), np.nan)
    fitting[lengths == width] = values[lengths == width][:, :width]
    return fitting
