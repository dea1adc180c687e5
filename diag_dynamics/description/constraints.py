# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Closed loops and non-linear mimic joints in a file beside a description."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from diag_dynamics.checks import array_of, choice, mapping, number, numbers, unit
from diag_dynamics.description.description import LOOP_TYPES, Curve, Description, Loop, LoopEnd
from diag_dynamics.exceptions import InputError
from diag_dynamics.yaml_files import read_yaml

COUPLINGS = "loops", "mimics", "flexible_links"
"""Keys of a file."""


class Couplings(NamedTuple):
    """Content of a file, and its path for errors."""

    name: str
    content: Mapping[str, Any]


def read_couplings(source: Any) -> Couplings:
    """Return the couplings of a YAML file or its content. A list has loops alone."""
    name = "loops"
    if isinstance(source, str | os.PathLike):
        name = os.fspath(source)
        source = read_yaml(source, os.fspath(source))
    if not isinstance(source, Mapping):
        source = {"loops": source}
    return Couplings(name, mapping(name, source, COUPLINGS))


def with_couplings(description: Description, couplings: Couplings) -> Description:
    """Return a description with loops and non-linear mimic joints.

    They replace loops of the robot's own file, and take from one of the same name the fields that
    they lack.
    """
    name, content = couplings
    entries = content.get("loops", description.loops) or ()
    if isinstance(entries, str | Mapping) or not isinstance(entries, Sequence):
        raise InputError(f"{name}: loops is {entries!r}; expected a list.")
    in_file = {loop.name: loop._asdict() for loop in description.loops}
    loops = tuple(_loop(name, k, entry, in_file) for k, entry in enumerate(entries))
    curves = dict(description.curves)
    for joint, entry in mapping(f"{name}: mimics", content.get("mimics") or {}).items():
        is_curve = isinstance(entry, Curve)
        curves[joint] = entry if is_curve else _curve(f"{name}: mimics of '{joint}'", entry)
    return description._replace(loops=loops, curves=curves)


def _loop(source: str, number_: int, entry: Any, in_file: Mapping[str, Any]) -> Loop:
    entry = mapping(f"{source}: loop {number_}", entry)
    entry = in_file.get(entry.get("name"), {}) | dict(entry)
    where = f"{source}: loop '{entry.get('name', number_)}'"
    entry = mapping(where, entry, Loop._fields, ("a", "b"))
    kind = entry.get("type", "point")
    choice(f"{where}: type", kind, LOOP_TYPES)
    start = {
        joint: number(f"{where}: start of '{joint}'", x, "a finite number [rad, m]")
        for joint, x in mapping(f"{where}: start", entry.get("start") or {}).items()
    }
    axis = unit(f"{where}: axis", entry.get("axis", (0.0, 0.0, 1.0)))
    independent = entry.get("independent") or ()
    independent = (independent,) if isinstance(independent, str) else independent
    if not isinstance(independent, list | tuple):
        raise InputError(f"{where}: independent is {independent!r}; expected a list of joints.")
    return Loop(
        str(entry.get("name", number_)),
        _end(f"{where}: a", entry["a"]),
        _end(f"{where}: b", entry["b"]),
        kind,
        tuple(axis.tolist()),
        tuple(map(str, independent)),
        start,
    )


def _end(where: str, entry: Any) -> LoopEnd:
    if isinstance(entry, str):
        return LoopEnd(entry)
    entry = mapping(where, entry, LoopEnd._fields, ["link"])
    vectors = (
        numbers(f"{where}: {key}", entry.get(key, (0, 0, 0)), (3,), "three numbers")
        for key in ("xyz", "rpy")
    )
    return LoopEnd(str(entry["link"]), *(tuple(vector.tolist()) for vector in vectors))


def _curve(where: str, entry: Any) -> Curve:
    entry = mapping(where, entry, ("source", "polynomial"), ("source", "polynomial"))
    coefficients = array_of(entry["polynomial"])
    count = 1 if coefficients is None else coefficients.size
    expected = "coefficients, the constant first"
    coefficients = numbers(f"{where}: polynomial", coefficients, (max(1, count),), expected)
    return Curve(str(entry["source"]), np.array([[0.0, *coefficients]]))
