# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Times of rows, to the nanosecond where the file has them so."""

import re
from datetime import datetime, timedelta, timezone
from decimal import Context, Decimal

import numpy as np

SECOND = 10**9

EPOCH = datetime(1970, 1, 1, tzinfo=timezone.utc)

LIMIT = 2**62
"""Largest stamp [ns], 146 years: the difference of two fits into 64 bits."""

_SHORT = 2.0**50 / SECOND
"""[s], 13 days: up to here a double holds nine decimals."""

_EXACT = Context(prec=60, Emax=999_999, Emin=-999_999, traps=[])
"""Without traps: 1e999999999 is a number that is cut, not an error."""

_ISO = re.compile(
    r"(?P<year>\d{4})(?P<dash>-?)(?P<month>\d\d)(?P=dash)(?P<day>\d\d)"
    r"[T ]\s*(?P<hour>\d\d)(?P<colon>:?)(?P<minute>\d\d)(?:(?P=colon)(?P<second>\d\d)(?:[.,](?P<fraction>\d+))?)?"
    r"\s*(?:Z|UTC|GMT|(?P<sign>[+-])(?P<hours>\d\d)(?::?(?P<minutes>\d\d))?)?(?:\[[\w/+-]+\])?",
    re.ASCII | re.IGNORECASE,
)
"""ISO 8601 in the extended and in the basic form; the name of a zone behind its offset, as Java has it, adds nothing."""


def of_floats(values, scale):
    """Times [s] and stamps [ns] of doubles.

    Parameters
    ----------
    values : (n,) array of float
        NaN has a stamp of 0: whoever calls leaves such rows out.
    scale : float
        [s], of a unit of the values.
    """
    per_second = round(1 / scale) if 1e-9 <= scale < 1 else 0
    divided = per_second and 1 / per_second == scale  # 5 / 1e6 is 5e-6, 5 * 1e-6 is not
    time = values / per_second if divided else values * scale
    whole = np.floor(np.clip(np.nan_to_num(time, nan=0.0, posinf=1e300, neginf=-1e300), -5e9, 5e9))
    part = np.clip(np.nan_to_num(time) - whole, 0.0, 1.0)
    stamp = whole.astype(np.int64) * SECOND + np.rint(part * SECOND).astype(np.int64)
    return time, np.clip(stamp, -LIMIT, LIMIT)


def of_integers(values, scale):
    """Times [s] and stamps [ns] of integers: exact, if a unit is a whole number of nanoseconds."""
    unit = Decimal(repr(scale)) * SECOND
    if unit < 1 or unit != int(unit):
        return of_floats(values.astype(float), scale)
    unit = int(unit)
    most = LIMIT // unit
    beyond = (values > most) | (values < -most)
    stamp = np.where(beyond, np.where(values > 0, LIMIT, -LIMIT), np.where(beyond, 0, values).astype(np.int64) * unit)
    return np.where(beyond, values * scale, stamp / SECOND), stamp


def of_texts(texts, scale):
    """Times [s] and stamps [ns] of texts: numbers to any digit, or dates as ISO 8601 has them, UTC without a zone.

    Parameters
    ----------
    texts : sequence of str
        What is neither is NaN.
    scale : float
        Of numbers only.
    """
    try:
        if any("_" in text for text in texts):
            raise ValueError
        floats = np.array(list(map(float, texts)), float)
        if survive_as_doubles(floats * scale):
            return of_floats(floats, scale)
        return of_integers(np.array(list(map(int, texts)), np.int64), scale)
    except (ValueError, OverflowError):
        return _one_by_one(texts, scale)


def _one_by_one(texts, scale):
    """As :func:`of_texts`, whatever they are."""
    time, stamp, unit = np.full(len(texts), np.nan), np.zeros(len(texts), np.int64), Decimal(repr(scale))
    for k, text in enumerate(texts):
        seconds = _seconds(text.strip(), unit)
        if seconds is not None:
            time[k] = float(seconds)
            cut = _EXACT.multiply(max(min(seconds, Decimal(5 * SECOND)), Decimal(-5 * SECOND)), Decimal(SECOND))
            stamp[k] = max(min(int(cut.to_integral_value()), LIMIT), -LIMIT)
    return time, stamp


def _seconds(text, unit):
    """A text as Decimal [s]; None if it is none."""
    if not text.isascii() or "_" in text:
        return None
    date = _ISO.fullmatch(text)
    if date is None:
        value = _EXACT.create_decimal(text)
        return None if value.is_nan() else _EXACT.multiply(value, unit)
    try:
        fields = ("year", "month", "day", "hour", "minute", "second")
        whole = datetime(*(int(date[one] or 0) for one in fields), tzinfo=timezone.utc)
        zone = timedelta(hours=int(date["hours"] or 0), minutes=int(date["minutes"] or 0))
        seconds = int((whole - EPOCH) / timedelta(seconds=1)) - int(f"{date['sign'] or '+'}1") * int(
            zone.total_seconds()
        )
    except (ValueError, OverflowError):  # the 30th of February
        return None
    return Decimal(seconds) + Decimal(f"0.{date['fraction'] or 0}")


def is_date(text):
    """Whether a text is a time as ISO 8601 has it."""
    return bool(_ISO.fullmatch(text.strip()))


def of_pairs(seconds, nanoseconds):
    """Times and stamps of two columns, as builtin_interfaces/Time has them: float64, whole numbers below 2^53."""
    known = np.isfinite(seconds) & np.isfinite(nanoseconds)
    whole = np.clip(np.where(known, seconds, 0.0), -5e9, 5e9)
    part = np.clip(np.where(known, nanoseconds, 0.0), -5e9, 5e9)
    stamp = np.clip(of_floats(whole, 1.0)[1] + np.rint(part).astype(np.int64), -LIMIT, LIMIT)
    return np.where(np.isnan(seconds) | np.isnan(nanoseconds), np.nan, seconds + nanoseconds / SECOND), stamp


def survive_as_doubles(time):
    """Whether times [s] are so short that a double has all their nine decimals."""
    known = np.abs(time[np.isfinite(time)])
    return known.size == 0 or known.max() < _SHORT


def unit_in_doubt(time):
    """What times look like that cannot be seconds: ``ms``, ``us`` or ``ns`` since 1970; None if they can.

    The middle one decides: single rows may hold garbage.
    """
    known = np.abs(time[np.isfinite(time)])
    middle = float(np.median(known)) if known.size else 0.0
    if middle < 1e11:  # the year 5138
        return None
    return "ms" if middle < 1e14 else "us" if middle < 1e17 else "ns"
