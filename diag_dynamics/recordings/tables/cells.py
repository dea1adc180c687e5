# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Cells of a table, arrays of pyarrow, as times, numbers, lists of numbers and texts."""

import re
from contextlib import suppress
from datetime import datetime
from decimal import Context, Decimal

import numpy as np
import pyarrow as pa
from pyarrow import compute as pc

from diag_dynamics.joint_states.stamps import SECOND
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

_LIMIT = 4 * 10**18  # [ns], of stamps: the difference of two fits into 64 bits
_SHORT = 2.0**50 / SECOND  # [s], 13 days: up to here a double holds nine decimals
_EXACT = Context(prec=40, traps=[])
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
        lose("text where a number belongs", "fields are NaN", lost, f"'{texts[lost[0]][:40]}'")
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
    """Return times [s], NaN if missing, and stamps [ns]; `scale` is that of numbers [s].

    Stamps are exact for integers and texts.
    """
    kind = array.type
    if pa.types.is_timestamp(kind) or pa.types.is_duration(kind):
        array = array.cast(pa.int64())
        scale = UNITS["time"][kind.unit]
    elif pa.types.is_decimal(kind):
        array = array.cast(pa.string())
    if pa.types.is_integer(array.type):
        return _scale_integers(array, scale)
    if not pa.types.is_string(array.type):
        return _scale_floats(_to_numpy(array), scale)
    with suppress(pa.ArrowInvalid):
        values = _to_numpy(array)
        if not (np.abs(values * scale) > _SHORT).any():
            return _scale_floats(values, scale)
    unit = Decimal(repr(scale))
    stamps = []
    seconds = [_parse_time(text, unit) for text in read_texts(array)]
    for second in seconds:
        exact = Decimal(0) if second.is_nan() else _EXACT.multiply(second, SECOND)
        stamps.append(round(max(min(exact, _LIMIT), -_LIMIT)))
    return np.array(seconds, float), np.array(stamps, np.int64)


def _scale_floats(values, scale):
    inverse = np.rint(1 / scale)
    divided = scale < 1 and inverse and 1 / inverse == scale  # 5 / 1e6 is 5e-6, 5 * 1e-6 is not
    time = values / inverse if divided else values * scale
    whole = np.floor(np.clip(np.nan_to_num(time), -_LIMIT / SECOND, _LIMIT / SECOND))
    part = np.clip(np.nan_to_num(time) - whole, 0.0, 1.0)
    return time, whole.astype(np.int64) * SECOND + np.rint(part * SECOND).astype(np.int64)


def _scale_integers(array, scale):
    """Return times and stamps; these are exact if the unit is a whole number of nanoseconds."""
    values = array.fill_null(0).to_numpy(zero_copy_only=False)
    unit = round(scale * SECOND)
    time, stamp = _scale_floats(values.astype(float), scale)
    if unit / SECOND == scale:
        small = np.abs(time) < _LIMIT / SECOND
        stamp[small] = values[small].astype(np.int64) * unit
    time[array.is_null().to_numpy(zero_copy_only=False)] = np.nan
    return time, stamp


def _parse_time(text, unit):
    """Return the time in a text as Decimal [s]; NaN if it is no time."""
    date = _ISO.fullmatch(text)
    if date is None:
        plain = text.isascii() and "_" not in text
        return _EXACT.multiply(_EXACT.create_decimal(text), unit) if plain else Decimal("nan")
    day, clock, fraction, zone = date.groups()
    try:
        moment = datetime.fromisoformat(f"{day}T{clock}{zone or '+00:00'}")
    except ValueError:  # the 30th of February
        return Decimal("nan")
    return round(moment.timestamp()) + Decimal(f"0.{fraction or 0}")
