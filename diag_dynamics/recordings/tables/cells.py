# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Cells of a table, arrays of pyarrow, as times, numbers, lists of numbers and texts."""

import re
from contextlib import suppress
from datetime import datetime

import numpy as np
import pyarrow as pa
from pyarrow import compute as pc

from diag_dynamics.recordings.tables.headers import UNITS, Column

SAMPLE = 6  # first rows that show what a column holds
BLANK = (
    "",
    "NA",
    "N/A",
    "n/a",
    "#N/A",
    "null",
    "NULL",
    "None",
    "none",
    "-",
    "--",
)  # nan is a value that was sent
MISSING = frozenset((*BLANK, "nan", "NaN", "NAN", "-nan", "-NaN"))  # texts that stand for no number

_ISO = re.compile(
    r"(\d{4}-\d\d-\d\d)[T ](\d\d:\d\d(?::\d\d)?)(?:[.,](\d+))?(?:Z|([+-]\d\d:\d\d))?", re.ASCII
)
"""ISO 8601 in the extended form: date, time, fraction, and offset of the zone."""


# --- Texts ---


def unify(array):
    """Return an array without a dictionary; texts are stripped, and null if empty."""
    if pa.types.is_dictionary(array.type):
        array = array.dictionary_decode()
    if str(array.type) in ("string", "large_string", "string_view"):
        array = pc.utf8_trim_whitespace(array.cast(pa.string()))
        return pc.if_else(pc.is_in(array, pa.array(BLANK)), None, array)
    return array


def read_texts(array):
    """Return the texts of a column, empty for null; None for a column of other types."""
    return [cell or "" for cell in array.to_pylist()] if pa.types.is_string(array.type) else None


def is_date(text):
    """Return whether a text is a time in ISO 8601."""
    return bool(_ISO.fullmatch(text.strip()))


def is_number(text):
    """Return whether a text is a number, with a decimal point or comma, or a time."""
    if text.strip() in MISSING:
        return False
    return _parse_number(text.replace(",", ".")) is not None or is_date(text)


def _parse_number(text):
    """Return the number in a text, NaN for a text of MISSING; None for any other text."""
    with suppress(ValueError):
        text = text.strip()
        return np.nan if text in MISSING else None if "_" in text else float(text)
    return None


def make_column(name, array, unit=None, is_text=False):
    """Return the Column of an array with the first rows; columns of a text are numbers if empty."""
    kind = array.type
    values = array.to_pylist()
    texts = tuple("" if value is None else str(value) for value in values[:SAMPLE])
    column = Column(name, unit=unit or None, type=str(kind), sample=texts)
    if is_list(kind):
        width = len(next(filter(None, values), ()))
        is_array = width > 0 and _is_numeric(kind.value_type)
        return column._replace(width=width * is_array, numeric=is_array)
    if pa.types.is_string(kind):
        filled = [text for text in texts if text not in MISSING]
        numeric = any(map(is_number, filled)) or (is_text and not filled)
        return column._replace(numeric=numeric, moments=bool(filled) and all(map(is_date, filled)))
    moments = pa.types.is_timestamp(kind) or pa.types.is_duration(kind)
    return column._replace(numeric=_is_numeric(kind), moments=moments)


def is_list(kind):
    """Return whether a type of pyarrow is of lists."""
    return hasattr(kind, "value_field")


def _is_numeric(kind):
    return any(
        getattr(pa.types, f"is_{name}")(kind) for name in ("integer", "floating", "decimal", "null")
    )


# --- Numbers ---


def read_numbers(array, lose):
    """Return the numbers of a column, (n,).

    Texts that are none are reported by `lose(cause, unit, rows, example)`.
    """
    with suppress(pa.ArrowInvalid):
        return _to_numpy(array)
    texts = read_texts(array)
    values = list(map(_parse_number, texts))
    if lost := [k for k, number in enumerate(values) if number is None]:
        text = texts[lost[0]]
        hint = " (decimal commas need `decimal: ','` in a column map)" if "," in text else ""
        example = f"'{text[:40]}'{hint}"
        lose("text where a number belongs", "fields are NaN", lost, example)
    return np.array(values, float)


def read_lists(array, width, lose):
    """Return the numbers of lists, (n, k); NaN for lists of another length than `width`."""
    lengths = _lengths(array)
    filled = np.arange(max(lengths.max(initial=0), width)) < lengths[:, None]
    values = np.full(filled.shape, np.nan)
    values[filled] = _to_numpy(array.flatten())
    odd = np.flatnonzero((lengths != width) & (lengths > 0))
    if odd.size:
        example = f"{lengths[odd[0]]} instead of {width}"
        lose("list of another length than there are joints", "rows of it are NaN", odd, example)
        values[odd] = np.nan
    return values[:, :width]


def _to_numpy(array):
    return array.cast(pa.float64(), safe=False).to_numpy(zero_copy_only=False)


def _lengths(array):
    return array.value_lengths().fill_null(0).to_numpy(zero_copy_only=False)


# --- Times ---


def read_times(array, scale):
    """Return times [s], NaN if missing; `scale` is that of numbers [s].

    They are long doubles, which hold nanoseconds since 1970.
    """
    kind = array.type
    if pa.types.is_timestamp(kind) or pa.types.is_duration(kind):
        array = array.cast(pa.int64())
        scale = UNITS["time"][kind.unit]
    elif pa.types.is_decimal(kind):
        array = array.cast(pa.string())
    unit = np.longdouble(repr(scale))
    if pa.types.is_string(array.type):
        texts = array.fill_null("nan").to_numpy(zero_copy_only=False)
        with suppress(ValueError):
            return texts.astype(np.longdouble) * unit
        return np.array([_parse_time(text, unit) for text in texts])
    if not pa.types.is_integer(array.type):
        return _to_numpy(array) * unit
    time = array.fill_null(0).to_numpy(zero_copy_only=False) * unit
    time[array.is_null().to_numpy(zero_copy_only=False)] = np.nan
    return time


def _parse_time(text, unit):
    """Return the time in a text as a long double [s]; NaN if it is no time."""
    date = _ISO.fullmatch(text)
    with suppress(ValueError):  # such as the 30th of February
        if date is None:
            return np.longdouble(text) * unit
        day, clock, fraction, zone = date.groups()
        moment = datetime.fromisoformat(f"{day}T{clock}{zone or '+00:00'}")
        return round(moment.timestamp()) + np.longdouble(f"0.{fraction or 0}")
    return np.longdouble("nan")
