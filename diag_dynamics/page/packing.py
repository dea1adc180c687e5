# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Numbers and meshes made small for a page that is a file: 16 bits each, differences, gzip."""

from __future__ import annotations

import gzip
from typing import Any, NamedTuple

import numpy as np

from diag_dynamics.arrays import Array

LEVELS = 65_000
"""Values that a column can have between its smallest and its largest one, if nothing else is said."""

PER_DIFFERENCE = 1.4826 / np.sqrt(6.0)
"""Standard deviation of white noise by the median magnitude of its second differences: of smooth signals these vanish."""

UNKNOWN = 0
"""What stands for a number that is not known; others begin at 1."""

LEVEL = 9
"""Of gzip."""


class Packed(NamedTuple):
    """Columns as bytes, and what is needed to have them back."""

    rows: int
    columns: list[list[float]]
    """Of each column: the value of 1, that of one more, and how often differences were taken (1 or 2)."""
    data: bytes


def pack(numbers: Any, levels: int = LEVELS, of_noise: float = 0.0) -> Packed:
    """Pack a matrix, column by column.

    Each is rounded to one of so many values between its smallest and its largest one: by no more than
    ``(largest - smallest) / (2 * levels)``. Columns of integers that span less are exact. What is not finite is unknown.

    Parameters
    ----------
    numbers : ndarray, shape (T, k)
    levels : int
        At most :data:`LEVELS`.
    of_noise : float
        A column that is measured is rounded to steps of this part of the standard deviation of its noise, where that is
        coarser: finer ones say nothing, and take room.
    """
    numbers = np.asarray(numbers, dtype=float)
    count, width = numbers.shape
    known = np.isfinite(numbers)
    columns, planes = [], np.empty((width, 2, count), dtype=np.uint8)
    for k in range(width):
        column, is_known = numbers[:, k], known[:, k]
        low, step = _scale(column[is_known], levels, of_noise)
        whole = np.zeros(count, dtype=np.uint16)
        whole[is_known] = np.rint((column[is_known] - low) / step).astype(np.uint16) + 1
        once = np.diff(whole, prepend=np.uint16(0))
        twice = np.diff(once, prepend=np.uint16(0))
        differences = [_zigzag(once), _zigzag(twice)]
        order = int(np.argmin([d.astype(np.int64).sum() for d in differences]))
        columns.append([low, step, order + 1])
        planes[k, 0], planes[k, 1] = differences[order] >> 8, differences[order] & 255
    return Packed(count, columns, gzip.compress(planes.tobytes(), LEVEL, mtime=0))


def _scale(known: Array, levels: int, of_noise: float) -> tuple[float, float]:
    """The smallest of some numbers, and the step from one value to the next."""
    if not len(known):
        return 0.0, 1.0
    low, high = float(known.min()), float(known.max())
    if high - low < levels and (known == np.rint(known)).all():
        return low, 1.0
    noise = float(np.median(np.abs(np.diff(known, 2)))) * PER_DIFFERENCE if len(known) > 2 else 0.0
    return low, max((high - low) / levels, of_noise * noise, np.finfo(float).tiny)


def _zigzag(difference: Any) -> Any:
    """Differences as small numbers, whichever sign they have."""
    signed = difference.astype(np.int16)
    return ((signed << 1) ^ (signed >> 15)).astype(np.uint16)


def pack_times(t: Array) -> bytes:
    """Times [s] that do not go back, to the microsecond: differences of 64 bits, in eight planes of bytes, gzip'd."""
    micro = np.rint(np.asarray(t) * 1e6).astype(np.int64)
    steps = np.maximum(np.diff(micro, prepend=0), 0).astype("<u8")
    return gzip.compress(steps.view(np.uint8).reshape(-1, 8).T.tobytes(), LEVEL, mtime=0)


# --- Meshes ---

CELLS = 96, 64, 44, 30, 20, 14
"""Cells along the longest side of a mesh, whose vertices in one cell become one, as far as that is needed."""


def pack_mesh(data: bytes, cells: int | None = None) -> bytes:
    """A mesh of :class:`~diag_dynamics.page.meshes.MeshLibrary`, gzip'd; with fewer vertices where cells are given."""
    vertices, triangles = np.frombuffer(data, "<u4", 2)
    points = np.frombuffer(data, "<f4", 3 * vertices, 8).reshape(-1, 3)
    faces = np.frombuffer(data, "<u4", 3 * triangles, 8 + 12 * int(vertices)).reshape(-1, 3)
    if cells is not None:
        points, faces = _thinned(points, faces, cells)
    low = points.min(axis=0, initial=np.inf) if len(points) else np.zeros(3)
    span = max(float(np.ptp(points, axis=0).max()), 1e-9) if len(points) else 1.0
    whole = np.rint((points - low) / span * 65535.0).astype("<u2")
    order, index = np.unique(faces, return_inverse=True)  # vertices that no face has are left out
    steps = _zigzag32(np.diff(index.reshape(-1).astype(np.int64), prepend=0))
    parts = (
        np.array([len(order), len(faces)], dtype="<u4").tobytes(),
        np.array([*low, span], dtype="<f4").tobytes(),
        _planes(np.diff(whole[order].T.reshape(-1), prepend=np.uint16(0)).astype("<u2"), 2),
        _planes(steps, 4),
    )
    return gzip.compress(b"".join(parts), LEVEL, mtime=0)


def pack_meshes(meshes: dict[str, bytes], most: int) -> dict[str, bytes]:
    """Meshes by their hashes, which together take no more bytes than that: with fewer vertices, the largest ones first.

    What is too large even then is left out, and drawn as nothing.
    """
    packed = {sha: pack_mesh(data) for sha, data in meshes.items()}
    for cells in CELLS:
        large = sorted(packed, key=lambda sha: -len(packed[sha]))
        for sha in large:
            if sum(map(len, packed.values())) <= most:
                return packed
            packed[sha] = min(packed[sha], pack_mesh(meshes[sha], cells), key=len)
    for sha in sorted(packed, key=lambda sha: -len(packed[sha])):
        if sum(map(len, packed.values())) <= most:
            break
        del packed[sha]
    return packed


def _thinned(points: Array, faces: Any, cells: int) -> tuple[Array, Any]:
    """Vertices of one cell become their mean; faces that have two of them are no more."""
    low, size = points.min(axis=0), max(float(np.ptp(points, axis=0).max()), 1e-9) / cells
    _, cell = np.unique(np.floor((points - low) / size).astype(np.int64), axis=0, return_inverse=True)
    cell = cell.reshape(-1)
    count = np.bincount(cell)
    means = np.stack([np.bincount(cell, points[:, axis]) / count for axis in range(3)], axis=1)
    kept = cell[faces]
    a, b, c = kept.T
    return means, np.unique(kept[(a != b) & (b != c) & (c != a)], axis=0)


def _zigzag32(difference: Any) -> Any:
    return np.where(difference < 0, -2 * difference - 1, 2 * difference).astype("<u4")


def _planes(numbers: Any, width: int) -> bytes:
    """First bytes of all numbers, then second ones, and so on: alike stands by alike."""
    return np.ascontiguousarray(numbers).view(np.uint8).reshape(-1, width).T.tobytes()
