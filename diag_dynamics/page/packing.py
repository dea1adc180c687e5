# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Compressed numbers and meshes of a report: differences of 16 bits, byte planes, gzip."""

import gzip
from typing import NamedTuple

import numpy as np

LEVELS = 65_000
"""Maximum number of different values of a column."""

PER_DIFFERENCE = 1.4826 / np.sqrt(6.0)
"""Standard deviation of white noise per median magnitude of its second differences."""

CELLS = 96, 64, 44, 30, 20, 14
"""Cells along the longest side of a mesh that is too large: vertices in one cell become one."""


class Packed(NamedTuple):
    """Columns as bytes; of each the value of 1, and the step. 0 is unknown."""

    columns: list
    data: bytes


def pack(numbers, levels=LEVELS, of_noise=0.0):
    """Pack a matrix, shape (T, k), column by column. Numbers that are not finite are unknown.

    A column is rounded to `levels` values between its minimum and maximum, or to steps of the fraction `of_noise` of the
    standard deviation of its noise, where these are coarser. Columns of integers that span less are exact.
    """
    columns, planes = [], []
    for column in np.asarray(numbers, dtype=float).T:
        known = np.isfinite(column)
        low, step = _scale(column[known], levels, of_noise)
        whole = np.zeros(len(column), dtype="<u2")
        whole[known] = np.rint((column[known] - low) / step) + 1
        columns.append([low, step])
        planes.append(_difference_planes(whole))
    return Packed(columns, _compress(b"".join(planes)))


def _scale(known, levels, of_noise):
    """Return the smallest number and the step from one value to the next."""
    if not len(known):
        return 0.0, 1.0
    low, high = float(known.min()), float(known.max())
    if high - low < levels and (known == np.rint(known)).all():
        return low, 1.0
    noise = float(np.median(np.abs(np.diff(known, 2)))) * PER_DIFFERENCE if len(known) > 2 else 0.0
    return low, max((high - low) / levels, of_noise * noise, np.finfo(float).tiny)


def pack_times(t):
    """Pack times [s] that do not decrease, to the microsecond."""
    return _compress(_difference_planes(np.maximum.accumulate(np.rint(np.asarray(t) * 1e6)).astype("<u8")))


def _difference_planes(whole):
    """Return first differences of unsigned integers, with the sign in the lowest bit: lowest bytes, then the next ones."""
    bits = 8 * whole.itemsize - 1
    differences = np.diff(whole, prepend=np.zeros(1, whole.dtype))  # they wrap around
    zigzag = (differences << 1) ^ (np.zeros_like(whole) - (differences >> bits))
    return zigzag.view(np.uint8).reshape(-1, whole.itemsize).T.tobytes()


def _compress(data):
    return gzip.compress(data, 6, mtime=0)


def pack_mesh(data, cells=None):
    """Pack a mesh of :class:`~diag_dynamics.page.meshes.MeshLibrary`; with fewer vertices where `cells` are given."""
    vertices, triangles = map(int, np.frombuffer(data, "<u4", 2))
    points = np.frombuffer(data, "<f4", 3 * vertices, 8).reshape(-1, 3)
    faces = np.frombuffer(data, "<u4", 3 * triangles, 8 + 12 * vertices).reshape(-1, 3)
    low, span = points.min(axis=0), max(float(np.ptp(points, axis=0).max()), 1e-9)
    if cells is not None:
        points, faces = _thin_out(points, faces, (points - low) * (cells / span))
    order, index = np.unique(faces, return_inverse=True)  # vertices without a face are left out
    whole = np.rint((points[order] - low) / span * 65535.0).astype("<u2")
    sizes, scale = np.array([len(order), len(faces)], dtype="<u4"), np.array([*low, span], dtype="<f4")
    planes = _difference_planes(whole.T.ravel()) + _difference_planes(index.ravel().astype("<u4"))
    return _compress(sizes.tobytes() + scale.tobytes() + planes)


def pack_meshes(meshes, most):
    """Pack meshes, by hash, into at most so many bytes: the largest ones lose vertices, or are left out in the end."""
    packed = {sha: pack_mesh(data) for sha, data in meshes.items()}
    for cells in (*CELLS, None):
        for sha in sorted(packed, key=lambda sha: -len(packed[sha])):
            if sum(map(len, packed.values())) <= most:
                return packed
            if cells is None:
                del packed[sha]
            else:
                packed[sha] = min(packed[sha], pack_mesh(meshes[sha], cells), key=len)
    return packed


def _thin_out(points, faces, places):
    """Replace vertices of one cell by their mean, and drop faces that have two of them."""
    _, cell = np.unique(np.floor(places).astype(np.int64), axis=0, return_inverse=True)
    cell = cell.ravel()
    means = np.stack([np.bincount(cell, axis) for axis in points.T], axis=1) / np.bincount(cell)[:, None]
    a, b, c = cell[faces].T
    return means, np.unique(cell[faces][(a != b) & (b != c) & (c != a)], axis=0)
