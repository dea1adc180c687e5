# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Values by name, as they are written in lists of parameters: ``joint=0.5``, ``*`` for all others; xacro arguments."""

import math
import os
import re
import shlex

from diag_dynamics.exceptions import InputError

ALL = "*"
"""Stands for every joint that has no entry of its own."""


ARGUMENT = re.compile(r"([A-Za-z_][\w.-]*):=(.*)", re.S)
"""One argument of a xacro file, ``NAME:=VALUE``, as xacro's own command line takes it."""

_WITH_ARGUMENTS = re.compile(r"(?P<path>.*?)\s+(?P<arguments>[A-Za-z_][\w.-]*:=.*)", re.S)

LARGEST = 1e9
"""Largest number that a parameter takes, but for those that say otherwise."""


def assignments(parameter, entries, kind=float, minimum=None):
    """Return values by name from strings such as ``joint=0.5``; empty strings do not count.

    `kind` is float, bool or str, the type behind the last ``=``. A number is at least `minimum`, and within ±:data:`LARGEST`.
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


def split_arguments(source):
    """Split ``PATH NAME:=VALUE …`` as a shell does into the path and a dict of values.

    All of `source` is the path if no argument follows it, or if there is a file of that name.
    """
    match = None if source.lstrip("\ufeff \t\r\n").startswith("<") else _WITH_ARGUMENTS.fullmatch(source)
    if match is None or os.path.isfile(os.path.expanduser(source)):
        return source, {}
    try:
        words = shlex.split(match["arguments"])
    except ValueError as error:
        raise InputError(f"The xacro arguments are {match['arguments']!r}; expected NAME:=VALUE …: {error}.") from error
    return match["path"], arguments_of(words)


def arguments_of(words):
    """Values by name of xacro arguments such as ``prefix:=left_``."""
    values = {}
    for word in words:
        match = ARGUMENT.fullmatch(word)
        if match is None:
            raise InputError(f"The xacro argument is {word!r}; expected NAME:=VALUE.")
        name, value = match.groups()
        if values.get(name, value) != value:
            raise InputError(f"The xacro argument '{name}' is {values[name]!r} and {value!r}; expected one value.")
        values[name] = value
    return values


def by_name(parameter, entries, names):
    """Entries with :data:`ALL` written out for these names."""
    for name in entries:
        if name != ALL and name not in names:
            raise InputError(f"parameter '{parameter}' names '{name}'; expected one of {', '.join(names)}.")
    if ALL in entries:
        return {name: entries.get(name, entries[ALL]) for name in names}
    return dict(entries)
