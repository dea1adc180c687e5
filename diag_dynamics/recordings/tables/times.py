# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Times of rows, to the nanosecond where the file has them so."""

import re
from datetime import datetime, timedelta, timezone
from decimal import Context, Decimal

import numpy as np
import pyarrow as pa
from pyarrow import compute as pc

SECOND = 10**9
LIMIT = 2**62
"""Largest stamp [ns]: the difference of two fits into 64 bits."""
_SHORT = 2.0**50 / SECOND
"""[s], 13 days: up to here a double holds nine decimals."""
_EXACT = Context(prec=40, traps=[])
_EPOCH = datetime(1970, 1, 1, tzinfo=timezone.utc)
_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
_ISO = re.compile(
    r"(?P<year>\d{4})(?P<dash>-?)(?P<month>\d\d)(?P=dash)(?P<day>\d\d)"
    r"[T ]\s*(?P<hour>\d\d)(?P<colon>:?)(?P<minute>\d\d)(?:(?P=colon)(?P<second>\d\d)(?:[.,](?P<fraction>\d+))?)?"
    r"\s*(?:Z|UTC|GMT|(?P<sign>[+-])(?P<hours>\d\d)(?::?(?P<minutes>\d\d))?)?(?:\[[\w/+-]+\])?",
    re.ASCII | re.IGNORECASE,
)
"""ISO 8601 in the extended and the basic form, with the name of a zone behind its offset."""


def is_date(text):
    """Return whether a text is a time in ISO 8601."""
    return bool(_ISO.fullmatch(text.strip()))


def read_times(array, scale, decimal="."):
    """Return times [s], NaN where one is missing, and stamps [ns] of an array of pyarrow; `scale` is the unit of numbers [s].

    Integers and texts are exact to the nanosecond. Texts are numbers or ISO 8601, UTC without a zone.
    """
    if decimal == ",":
        texts = ["" if one is None else str(one) for one in array.to_pylist()]
        array = pa.array([one if is_date(one) else "" if "." in one else one.replace(",", ".") for one in texts])
    kind = array.type
    if pa.types.is_timestamp(kind) or pa.types.is_duration(kind):
        array, scale = array.cast(pa.int64()), _UNITS[kind.unit]
    if pa.types.is_integer(array.type):
        time, stamp = _of_integers(array.fill_null(0).to_numpy(zero_copy_only=False), scale)
        return np.where(array.is_valid().to_numpy(zero_copy_only=False), time, np.nan), stamp
    if pa.types.is_floating(kind) or pa.types.is_null(kind):
        return _of_floats(array.cast(pa.float64()).to_numpy(zero_copy_only=False), scale)
    if pa.types.is_string(kind):
        try:
            values = array.cast(pa.float64()).to_numpy(zero_copy_only=False)
            if _is_short(values * scale):
                return _of_floats(values, scale)
            if scale == 1.0 and not array.null_count:
                nanoseconds = pc.multiply(array.cast(pa.decimal128(19, 9)), pa.scalar(SECOND, pa.decimal128(10)))
                return values, np.clip(nanoseconds.cast(pa.int64()).to_numpy(), -LIMIT, LIMIT)
            if not array.null_count:
                return _of_integers(array.cast(pa.int64()).to_numpy(), scale)
        except pa.ArrowInvalid:  # more digits, dates, or a text that is neither
            pass
    texts = [one.decode(errors="replace") if isinstance(one, bytes) else str(one or "") for one in array.to_pylist()]
    return _of_texts(texts, scale)


def read_pairs(seconds, nanoseconds):
    """Return times and stamps of whole seconds and nanoseconds in doubles."""
    known = np.isfinite(seconds) & np.isfinite(nanoseconds)
    whole = np.clip(np.where(known, seconds, 0.0), -5e9, 5e9)
    part = np.clip(np.where(known, nanoseconds, 0.0), -5e9, 5e9)
    stamp = np.clip(_of_floats(whole, 1.0)[1] + np.rint(part).astype(np.int64), -LIMIT, LIMIT)
    return np.where(np.isnan(seconds) | np.isnan(nanoseconds), np.nan, seconds + nanoseconds / SECOND), stamp


def doubtful_unit(time):
    """Return the unit, ``ms``, ``us`` or ``ns``, of times that cannot be seconds since 1970; None if they can."""
    known = np.abs(time[np.isfinite(time)])
    middle = float(np.median(known)) if known.size else 0.0
    if middle < 1e11:  # the year 5138
        return None
    return "ms" if middle < 1e14 else "us" if middle < 1e17 else "ns"


def _is_short(time):
    known = np.abs(time[np.isfinite(time)])
    return known.size == 0 or known.max() < _SHORT


def _of_floats(values, scale):
    per_second = round(1 / scale) if 1e-9 <= scale < 1 else 0
    divided = per_second and 1 / per_second == scale  # 5 / 1e6 is 5e-6, 5 * 1e-6 is not
    time = values / per_second if divided else values * scale
    whole = np.floor(np.clip(np.nan_to_num(time, nan=0.0), -5e9, 5e9))
    part = np.clip(np.nan_to_num(time) - whole, 0.0, 1.0)
    stamp = whole.astype(np.int64) * SECOND + np.rint(part * SECOND).astype(np.int64)
    return time, np.clip(stamp, -LIMIT, LIMIT)


def _of_integers(values, scale):
    """Times and stamps; exact if a unit is a whole number of nanoseconds."""
    unit = Decimal(repr(scale)) * SECOND
    if unit < 1 or unit != int(unit):
        return _of_floats(values.astype(float), scale)
    limit = LIMIT // int(unit)
    beyond = (values > limit) | (values < -limit)
    exact = np.where(beyond, 0, values).astype(np.int64) * int(unit)
    stamp = np.where(beyond, np.where(values > 0, LIMIT, -LIMIT), exact)
    return np.where(beyond, values * scale, stamp / SECOND), stamp


def _of_texts(texts, scale):
    time, stamp, unit = np.full(len(texts), np.nan), np.zeros(len(texts), np.int64), Decimal(repr(scale))
    for k, text in enumerate(texts):
        seconds = _seconds(text.strip(), unit)
        if not seconds.is_nan():
            time[k] = float(seconds)
            cut = max(min(seconds, Decimal(5 * SECOND)), Decimal(-5 * SECOND)) * SECOND
            stamp[k] = max(min(int(cut.to_integral_value()), LIMIT), -LIMIT)
    return time, stamp


def _seconds(text, unit):
    """A text as Decimal [s]; NaN if it is no time."""
    date = _ISO.fullmatch(text)
    if date is None:
        plain = text.isascii() and "_" not in text
        return _EXACT.multiply(_EXACT.create_decimal(text), unit) if plain else Decimal("nan")
    try:
        fields = ("year", "month", "day", "hour", "minute", "second")
        moment = datetime(*(int(date[one] or 0) for one in fields), tzinfo=timezone.utc)
    except ValueError:  # the 30th of February
        return Decimal("nan")
    zone = timedelta(hours=int(date["hours"] or 0), minutes=int(date["minutes"] or 0))
    offset = -zone if date["sign"] == "-" else zone
    return Decimal((moment - _EPOCH - offset) // timedelta(seconds=1)) + Decimal(f"0.{date['fraction'] or 0}")
