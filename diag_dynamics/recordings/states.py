# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""States of a robot in columns, the type that reading, analysis and identification share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from diag_dynamics.arrays import Array, BoolArray


@dataclass(frozen=True)
class States:
    """States of the whole robot in columns, as the monitor would evaluate them. All have T rows.

    ``states[rows]`` are the states of a slice, a mask or indices.

    Parameters
    ----------
    stamp, oldest_stamp : ndarray of int64, shape (T,)
        Stamps of the newest and of the oldest value in a state [ns].
    log_time : ndarray of int64, shape (T,)
        Log time of the message that completed the state [ns].
    position : ndarray, shape (T, nq)
        [rad, m]
    velocity : ndarray, shape (T, nv)
        [rad/s, m/s]
    effort : ndarray, shape (T, nv)
        [N m, N]; NaN where it is unknown.
    effort_known, stamp_received, velocity_estimated, jumped : ndarray of bool, shape (T,)
        Whether the effort of all joints is known; a time of reception stands for the stamp; a
        velocity is estimated from positions; positions jumped since the state before, so that no
        motion leads to this one.
    """

    stamp: Array
    oldest_stamp: Array
    log_time: Array
    position: Array
    velocity: Array
    effort: Array
    effort_known: BoolArray
    stamp_received: BoolArray
    velocity_estimated: BoolArray
    jumped: BoolArray

    def __len__(self) -> int:
        return len(self.stamp)

    def __getitem__(self, rows: Any) -> States:
        return States(*(column[rows] for column in self.columns()))

    def without_efforts(self, joints: Array) -> States:
        """Return these states with unknown efforts of some joints, bool (nv,)."""
        effort = np.where(joints, np.nan, self.effort)
        return replace(self, effort=effort, effort_known=self.effort_known & ~joints.any())

    def columns(self) -> tuple[Array, ...]:
        """Return all columns, in the order of the parameters."""
        return tuple(getattr(self, field.name) for field in fields(self))

    @classmethod
    def empty(cls, nq: int, nv: int) -> States:
        """Return no states of a robot with nq positions and nv velocities."""
        times = np.zeros((3, 0), np.int64)
        flags = np.zeros((4, 0), bool)
        return cls(*times, np.zeros((0, nq)), *np.zeros((2, 0, nv)), *flags)

    @classmethod
    def concatenate(cls, parts: Sequence[States]) -> States:
        """Return the states of several parts, one after the other."""
        return cls(*map(np.concatenate, zip(*(part.columns() for part in parts), strict=True)))
