# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Placements of all links at once, at one state or at many: what a drawing of the robot needs."""

from __future__ import annotations

import numpy as np

from diag_dynamics.arrays import Array
from diag_dynamics.model import RobotModel
from diag_dynamics.sweeps.bodies import FLOATING, PLANAR, PRISMATIC


class LinkPoses:
    """Gives the placements of all links of a robot in the world, which for a fixed base is its root link.

    Where many states are drawn, a joint takes one product of matrices for all of them: no loop is over states.

    Parameters
    ----------
    model : RobotModel
    """

    def __init__(self, model: RobotModel) -> None:
        bodies = model.bodies
        self._bodies = [(int(body["parent"]), int(body["kind"]), int(body["rank"]), int(body["q"])) for body in bodies]
        self._single = bodies["dofs"] == 1
        self._index = np.where(self._single, bodies["q"], 0)
        self._scale = np.where(self._single, bodies["multiplier"], 0.0)
        self._offset = np.where(self._single, bodies["offset"], 0.0)
        rest = np.tile(np.eye(4), (len(bodies), 1, 1))
        rest[1:, :3, :3] = bodies["rotation"][1:].reshape(-1, 3, 3)
        rest[1:, :3, 3] = bodies["translation"][1:]
        self._rest = rest
        # A single joint's placement is rest + sin·S + (cos − 1)·C, or rest + position·S along its axis.
        self._slides = bodies["kind"] == PRISMATIC
        turns = (self._single & ~self._slides).astype(float)[:, None]
        self._sine, self._cosine = np.zeros((2, len(bodies), 4, 4))
        self._sine[:, :, 0], self._sine[:, :, 1] = turns * rest[:, :, 1], -turns * rest[:, :, 0]
        self._cosine[:, :, 0], self._cosine[:, :, 1] = turns * rest[:, :, 0], turns * rest[:, :, 1]
        self._sine[self._slides, :3, 3] = rest[self._slides, :3, 2]
        placed = [model.placement_in_body(link) for link in model.link_names]
        self._body_of_link = np.array([body for body, _ in placed])
        self._in_body = np.array([placement for _, placement in placed])

    def matrices(self, q: Array) -> Array:
        """Placements, shape (T, links, 4, 4), at positions of shape (T, nq): axes, and in the last column the origin [m]."""
        position = q[:, self._index] * self._scale + self._offset if q.shape[1] else np.zeros((len(q), len(self._rest)))
        along = np.where(self._slides, position, np.sin(position))[:, :, None, None]
        bent = (np.cos(position) - 1.0)[:, :, None, None]
        placed = self._rest + along * self._sine + bent * self._cosine
        for k, (parent, kind, rank, first) in enumerate(self._bodies):
            if k and not self._single[k] and not rank:
                placed[:, k] = placed[:, k] @ _several(kind, q[:, first:])
            if parent:
                placed[:, k] = placed[:, parent] @ placed[:, k]
        return placed[:, self._body_of_link] @ self._in_body

    def poses(self, q: Array) -> Array:
        """Placements as x y z [m] and qx qy qz qw, shape (T, links, 7); qw is never negative."""
        matrices = self.matrices(q)
        poses = np.empty((*matrices.shape[:2], 7))
        poses[:, :, :3] = matrices[:, :, :3, 3]
        poses[:, :, 3:] = quaternions(matrices[:, :, :3, :3])
        return poses


def _several(kind: int, q: Array) -> Array:
    """Motion of a planar or floating joint, shape (T, 4, 4), at its positions."""
    motion = np.tile(np.eye(4), (len(q), 1, 1))
    if kind == PLANAR:
        c, s = np.cos(q[:, 2]), np.sin(q[:, 2])
        motion[:, :2, 3] = q[:, :2]
        motion[:, 0, 0], motion[:, 0, 1], motion[:, 1, 0], motion[:, 1, 1] = c, -s, s, c
    elif kind == FLOATING:
        x, y, z, w = (q[:, 3:7] / np.linalg.norm(q[:, 3:7], axis=1, keepdims=True)).T
        motion[:, :3, 3] = q[:, :3]
        motion[:, 0, :3] = np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)], axis=1)
        motion[:, 1, :3] = np.stack([2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)], axis=1)
        motion[:, 2, :3] = np.stack([2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)], axis=1)
    return motion


def quaternions(R: Array) -> Array:
    """Quaternions qx qy qz qw of rotations, shape (…, 3, 3), with qw ≥ 0.

    Of the four rows of 4 q qᵀ, which is linear in R, that with the largest diagonal entry: the factor by which it is the
    quaternion is never small.
    """
    outer = (R.reshape(-1, 9) @ _OUTER + _CONSTANT).reshape(-1, 4, 4)
    each, diagonal = np.arange(len(outer)), outer[:, _FOUR, _FOUR]
    longest = diagonal.argmax(axis=1)
    factor = 0.5 / np.sqrt(diagonal[each, longest])
    row = outer[each, longest]
    return (row * np.copysign(factor, row[:, 3])[:, None]).reshape(*R.shape[:-2], 4)


def _linear() -> tuple[Array, Array]:
    """4 q qᵀ, row by row, as a linear function of R, row by row: its matrix and its constant."""
    matrix, constant = np.zeros((9, 4, 4)), np.eye(4)
    signs = np.array([[1, -1, -1], [-1, 1, -1], [-1, -1, 1], [1, 1, 1]])
    for i in range(4):
        matrix[[0, 4, 8], i, i] = signs[i]
    for i, j, k, sign in ((0, 1, 2, 1), (0, 2, 1, 1), (1, 2, 0, 1), (0, 3, 0, -1), (1, 3, 1, -1), (2, 3, 2, -1)):
        if sign > 0:  # x y: R_10 + R_01, and so on
            high, low = 3 * j + i, 3 * i + j
        else:  # x w: R_21 − R_12, and so on round
            high, low = 3 * ((k + 2) % 3) + (k + 1) % 3, 3 * ((k + 1) % 3) + (k + 2) % 3
        matrix[high, i, j] = matrix[high, j, i] = 1
        matrix[low, i, j] = matrix[low, j, i] = sign
    return matrix.reshape(9, 16), constant.ravel()


_OUTER, _CONSTANT = _linear()
_FOUR = np.arange(4)
