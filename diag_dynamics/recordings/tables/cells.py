# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Cells of a table, arrays of pyarrow, as times, numbers, lists of numbers and texts."""

import re
from contextlib import suppress
from decimal import Context, Decimal

import numpy as np
import pyarrow as pa
from pyarrow import compute as pc

from diag_dynamics.joint_states.stamps import SECOND
from diag_dynamics.recordings.tables.headers import Column

SAMPLE = 6  # first rows that show what a column holds
MAX_LENGTH = 10_000  # bytes of a text
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
_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
_ISO = re.compile(
    r"(?P<year>\d{4})(?P<dash>-?)(?P<month>\d\d)(?P=dash)(?P<day>\d\d)"
    r"[T ]\s*(?P<hour>\d\d)(?P<colon>:?)(?P<minute>\d\d)(?:(?P=colon)(?P<second>\d\d)(?:[.,](?P<fraction>\d+))?)?"
    r"\s*(?:Z|UTC|GMT|(?P<sign>[+-])(?P<hours>\d\d):?(?P<minutes>\d\d)?)?(?:\[[\w/+-]+\])?",
    re.ASCII | re.IGNORECASE,
)
"""ISO 8601 in the extended and the basic form, with the name of a zone behind its offset."""


# --- Texts ---


def unify(array):
    """Return an array without a dictionary; texts stripped, null if empty, or if binary and long."""
    if pa.types.is_dictionary(array.type):
        array = array.dictionary_decode()
    kind = str(array.type)
    if "binary" in kind:
        texts = (one if one and len(one) <= MAX_LENGTH else b"" for one in array.to_pylist())
        array = pa.array([one.decode(errors="replace") for one in texts], pa.string())
    if "binary" in kind or kind in ("string", "large_string", "string_view"):
        array = pc.utf8_trim_whitespace(array.cast(pa.string()))
        return pc.if_else(pc.is_in(array, pa.array(BLANK)), None, array)
    return array


def read_texts(array):
    """Return the texts of a column, empty for null; None for a column of other types."""
    return [one or "" for one in array.to_pylist()] if pa.types.is_string(array.type) else None


def is_date(text):
    """Return whether a text is a time in ISO 8601."""
    return bool(_ISO.fullmatch(text.strip()))


def is_number(text):
    """Return whether a text is a number, with a decimal point or comma, or a time."""
    given = text.strip() not in MISSING
    return given and (_parse_number(text.replace(",", ".")) is not None or is_date(text))


def _parse_number(text):
    """Return the number in a text, NaN for a text of MISSING; None for any other text."""
    with suppress(ValueError):
        text = text.strip()
        return np.nan if text in MISSING else None if "_" in text else float(text)
    return None


def make_column(name, array, unit=None, is_text=False):
    """Return the Column of an array with the first rows; columns of a text are numbers if empty."""
    kind, values = array.type, array.to_pylist()
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


def are_blank(array):
    """Return whether cells hold nothing, bool (n,): null or an empty list."""
    if is_list(array.type):
        return _lengths(array) == 0
    return array.is_null().to_numpy(zero_copy_only=False)


# --- Numbers ---


def read_numbers(array, lose):
    """Return the numbers of a column, (n,), and report texts that are none by `lose(cause, unit, rows, example)`."""
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
    """Return times [s], NaN if missing, and stamps [ns], exact for integers and texts; `scale` of numbers [s]."""
    kind = array.type
    if pa.types.is_timestamp(kind) or pa.types.is_duration(kind):
        array, scale = array.cast(pa.int64()), _UNITS[kind.unit]
    elif pa.types.is_decimal(kind):
        array = array.cast(pa.string())
    if pa.types.is_string(array.type):
        with suppress(pa.ArrowInvalid):
            array = array.cast(pa.int64())
    if pa.types.is_integer(array.type):
        return _scale_integers(array, scale)
    if not pa.types.is_string(array.type):
        return _scale_floats(_to_numpy(array), scale)
    with suppress(pa.ArrowInvalid):
        values = _to_numpy(array)
        if not (np.abs(values * scale) > _SHORT).any():
            return _scale_floats(values, scale)
        if scale == 1.0 and not array.null_count:
            nanoseconds = pa.scalar(SECOND, pa.decimal128(10))
            exact = pc.multiply(array.cast(pa.decimal128(19, 9)), nanoseconds)
            return values, np.clip(exact.cast(pa.int64()).to_numpy(), -_LIMIT, _LIMIT)
    unit, stamps = Decimal(repr(scale)), []
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
    values, unit = array.fill_null(0).to_numpy(zero_copy_only=False), round(scale * SECOND)
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
    fields = date.groupdict("00")
    text = "{year}-{month}-{day}T{hour}:{minute}:{second}".format(**fields)
    try:
        moment = int(np.datetime64(text, "s").astype(int))
    except ValueError:  # the 30th of February
        return Decimal("nan")
    offset = 3600 * int(fields["hours"]) + 60 * int(fields["minutes"])
    moment += offset if fields["sign"] == "-" else -offset
    return moment + Decimal(f"0.{fields['fraction']}")
