# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Values by name, as they are written in lists of parameters: ``joint=0.5``, ``*`` for all others."""

import math

from diag_dynamics.exceptions import InputError

ALL = "*"
"""Stands for every joint that has no entry of its own."""


LARGEST = 1e9
"""Largest number that a parameter takes, but for those that say otherwise."""


def assignments(parameter, entries, kind=float, minimum=None):
    """Values by name from strings such as ``joint=0.5``.

    Parameters
    ----------
    parameter : str
        Whose entries they are.
    entries : sequence of str
        Empty strings count for nothing: an empty list of strings cannot be told from one of anything else.
    kind : {float, bool, str}
        What stands behind the last ``=``.
    minimum : float or None
        Smallest number allowed; the largest is :data:`LARGEST`, either way.

    Raises
    ------
    InputError
        An entry is malformed, of the wrong kind or out of range, or a name has two.
    """
    values = {}
    for entry in entries:
        if not entry:
            continue
        name, equals, text = entry.rpartition("=")
        name, text = name.strip(), text.strip()
        if not equals or not name:
            raise InputError(f"parameter '{parameter}' has {entry!r}, expected name={_EXPECTED[kind]}.")
        if name in values:
            raise InputError(f"parameter '{parameter}' has two entries for '{name}'.")
        value = _parsed(text, kind)
        if value is None:
            raise InputError(f"parameter '{parameter}' has {entry!r}, expected name={_EXPECTED[kind]}.")
        if minimum is not None and value < minimum:
            raise InputError(f"parameter '{parameter}' has {entry!r}, expected no less than {minimum:g}.")
        if kind is float and abs(value) > LARGEST:
            raise InputError(f"parameter '{parameter}' has {entry!r}, expected a number within ±{LARGEST:g}.")
        values[name] = value
    return values


_EXPECTED = {float: "number", bool: "true or name=false", str: "text"}


def _parsed(text, kind):
    """The value of a text, or None."""
    if kind is bool:
        return {"true": True, "false": False}.get(text.lower())
    if kind is str:
        return text
    try:
        number = float(text)
    except ValueError:
        return None
    return number if math.isfinite(number) else None


def by_name(parameter, entries, names):
    """Entries with :data:`ALL` written out for these names.

    Raises
    ------
    InputError
        An entry for another name.
    """
    for name in entries:
        if name != ALL and name not in names:
            raise InputError(f"parameter '{parameter}' names '{name}', which is no joint whose state is needed here.")
    if ALL in entries:
        return {name: entries.get(name, entries[ALL]) for name in names}
    return dict(entries)
