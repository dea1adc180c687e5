# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Values by name in lists of parameters: ``joint=0.5``, ``*`` for all others; xacro arguments."""

import argparse
import math
import os
import re
import shlex

from diag_dynamics.exceptions import InputError
from diag_dynamics.text import shortened

ALL = "*"
"""Name for every joint without an entry of its own."""


ARGUMENT = re.compile(r"([A-Za-z_][\w.-]*):=(.*)", re.S)
"""One argument of a xacro file, ``NAME:=VALUE``, as xacro's own command line takes it."""

_WITH_ARGUMENTS = re.compile(r"(?P<path>.*?)\s+(?P<arguments>[A-Za-z_][\w.-]*:=.*)", re.S)

LARGEST = 1e9
"""Largest number of a parameter without other bounds."""


class Parser(argparse.ArgumentParser):
    """A parser of a command line, whose errors are shortened."""

    def error(self, message):
        """See argparse."""
        super().error(shortened(message))


def assignments(parameter, entries, kind=float, minimum=None, advice=""):
    """Return values by name from strings such as ``joint=0.5``; empty strings do not count.

    `kind` is float, bool or str, the type behind the last ``=``. A number is at least `minimum` and
    within ±:data:`LARGEST`. The error about another value ends in `advice`.
    """
    values = {}
    for entry in entries:
        if not entry:
            continue
        name, equals, text = entry.rpartition("=")
        name = name.strip()
        value = _parsed(text.strip(), kind)
        title = f"parameter '{parameter}' has {entry!r}"
        if not equals or not name or value is None:
            raise InputError(f"{title}; expected name={_EXPECTED[kind]}.{advice}")
        if name in values:
            raise InputError(f"parameter '{parameter}' has two entries for '{name}'; expected one.")
        if minimum is not None and value < minimum:
            raise InputError(f"{title}; expected no less than {minimum:g}.")
        if kind is float and abs(value) > LARGEST:
            raise InputError(f"{title}; expected a number within ±{LARGEST:g}.")
        values[name] = value
    return values


_EXPECTED = {float: "number", bool: "true or name=false", str: "text"}


def _parsed(text, kind):
    """Return the value of a text, or None."""
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
    is_text = source.lstrip("\ufeff \t\r\n").startswith("<")
    match = None if is_text else _WITH_ARGUMENTS.fullmatch(source)
    if match is None or os.path.isfile(os.path.expanduser(source)):
        return source, {}
    try:
        words = shlex.split(match["arguments"])
    except ValueError as error:
        title = f"The xacro arguments are {match['arguments']!r}"
        raise InputError(f"{title}; expected NAME:=VALUE …: {error}.") from error
    return match["path"], arguments_of(words)


def arguments_of(words):
    """Return values by name of xacro arguments such as ``prefix:=left_``."""
    values = {}
    for word in words:
        match = ARGUMENT.fullmatch(word)
        if match is None:
            raise InputError(f"The xacro argument is {word!r}; expected NAME:=VALUE.")
        name, value = match.groups()
        if values.get(name, value) != value:
            pair = f"{values[name]!r} and {value!r}"
            raise InputError(f"The xacro argument '{name}' is {pair}; expected one value.")
        values[name] = value
    return values


def by_name(parameter, entries, names):
    """Return entries with :data:`ALL` replaced by all other names."""
    for name in entries:
        if name != ALL and name not in names:
            expected = ", ".join(names)
            raise InputError(f"parameter '{parameter}' names '{name}'; expected one of {expected}.")
    if ALL in entries:
        return {name: entries.get(name, entries[ALL]) for name in names}
    return dict(entries)
