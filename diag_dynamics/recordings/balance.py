# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Balance of power as a judgement: how much of the change of energy the model and the efforts explain."""

from typing import NamedTuple

import numpy as np

from diag_dynamics.assembly.stamps import SECOND
from diag_dynamics.compiled.tables import Addresses
from diag_dynamics.recordings.explained import (
    LEAST,
    MAX_GAP,
    STILL,
    WINDOW,
    Variances,
    culprits_of,
    explained_share,
    is_judged,
    judgement,
    likely_cause,
)
from diag_dynamics.recordings.kernels import prepare
from diag_dynamics.recordings.kernels.balance import BALANCE, COLUMNS, HAS_STATE, SUMMED, WHOLE, sum_windows


class Windows(NamedTuple):
    """Windows that ended in a piece; powers are means over each [W]."""

    begin: np.ndarray
    """Stamps of their first and last states [ns], int64, shape (W,)."""
    end: np.ndarray
    kinetic: np.ndarray
    """dK/dt."""
    effort: np.ndarray
    """νᵀε."""
    gravity: np.ndarray
    """νᵀε_g, the rate of potential energy."""
    friction: np.ndarray
    """νᵀε_fric."""
    gained: np.ndarray
    """Change of ½ν_k², shape (W, nv)."""
    explained: np.ndarray
    """ν_k(ε_k − C_k − ε_g,k − ε_fric,k), shape (W, nv)."""

    @property
    def residual(self):
        """dK/dt less what is put down to it, shape (W,)."""
        return self.kinetic - (self.effort - self.gravity - self.friction)


class Moments:
    """Number, mean and variance of what comes in pieces, in each column."""

    def __init__(self, shape=(), count=0, mean=0.0, squares=0.0):
        self.count, self.mean, self._squares = count, np.full(shape, mean), np.full(shape, squares)

    def take(self, values):
        """Take in values, along the first axis (Chan, Golub and LeVeque 1983)."""
        count = len(values)
        if not count:
            return
        mean = values.mean(axis=0)
        apart, total = mean - self.mean, self.count + count
        self._squares = self._squares + ((values - mean) ** 2).sum(axis=0) + apart**2 * (self.count * count / total)
        self.mean = self.mean + apart * (count / total)
        self.count = total

    @property
    def variance(self):
        """Mean squared distance from the mean; 0 of nothing."""
        return self._squares / max(self.count, 1)

    @property
    def square(self):
        """Mean of the squares."""
        return self.variance + self.mean**2

    def told(self):
        """Arguments that make the same one again, but for the shape: numbers."""
        return {"count": self.count, "mean": float(self.mean), "squares": float(self._squares)}

    def add(self, other):
        """Take in what another one has."""
        if not other.count:
            return
        apart, total = other.mean - self.mean, self.count + other.count
        self._squares = self._squares + other._squares + apart**2 * (self.count * other.count / total)
        self.mean = self.mean + apart * (other.count / total)
        self.count = total


class WindowSums:
    """Sums powers over windows, piece by piece.

    Parameters
    ----------
    count : int
        Degrees of freedom.
    friction : bool
        Whether evaluations have it.
    length : float
        Of a window [s].
    max_gap : float
        Time without states beyond which a window begins anew [s].
    """

    def __init__(self, count, friction=False, length=WINDOW, max_gap=MAX_GAP):
        self._friction, self._length, self._max_gap = friction, round(length * SECOND), max_gap
        self._flags, self._stamp = np.zeros(3, dtype=int), np.zeros(2, dtype=int)
        self._sums = {
            "before": np.zeros(count),
            "powers": np.zeros(3),
            "begun": np.zeros(count),
            "work": np.zeros((2, max(count, 3))),
        }
        self._own = Addresses(BALANCE, flags=self._flags, stamp=self._stamp, **self._sums)
        prepare(sum_windows)

    def take(self, states, s):
        """Take in states and their BatchEvaluation; returns :class:`Windows`."""
        width = s.nu.shape[1]
        most = self._most(states.stamp)
        bounds, windows, joints = np.empty((most, 2), int), np.empty((most, len(COLUMNS))), np.empty((2, most, width))
        summed = Addresses(
            SUMMED,
            stamp=np.ascontiguousarray(states.stamp),
            with_effort=np.ascontiguousarray(states.effort_known),
            moved=np.ascontiguousarray(states.jumped),
            nu=s.nu,
            coriolis=s.coriolis,
            gravity=s.gravity,
            epsilon=s.epsilon,
            friction=s.friction if self._friction else np.zeros((0, width)),
            bounds=bounds,
            windows=windows,
            gained=joints[0],
            explained=joints[1],
        )
        ended = sum_windows(self._own.at, summed.at, self._length, self._max_gap)
        return Windows(*bounds[:ended].T, *windows[:ended].T, *joints[:, :ended])

    def _most(self, stamps):
        """How many windows can end: one at each multiple of the length that is passed, and one that began before."""
        forward = np.maximum(np.diff(stamps), 0).sum()
        return min(len(stamps), int(forward // self._length) + 2)

    def memory(self):
        """What later results depend on; see `diag_dynamics.recordings.seams`."""
        if not self._flags[HAS_STATE]:
            return None
        return {
            "whole": bool(self._flags[WHOLE]),
            "stamp": self._stamp[: 1 + self._flags[WHOLE]].copy(),
            **{
                name: values.copy()
                for name, values in self._sums.items()
                if self._flags[WHOLE] or name not in ("begun", "work")
            },
        }


class Balance:
    """Judges windows.

    Parameters
    ----------
    names : sequence of str
        Degrees of freedom.

    Attributes
    ----------
    moved : bool or None
        Whether any joint has moved; None where that is not known, and dK/dt must tell.
    """

    def __init__(self, names):
        self._names, self.moved = tuple(names), None
        self.kinetic, self.total, self.residual = Moments(), Moments(), Moments()
        self.effort, self.needed, self.weightless = Moments(), Moments(), Moments()
        self.joints = Moments(len(names))

    def take(self, windows):
        """Take in :class:`Windows`."""
        self.kinetic.take(windows.kinetic)
        self.total.take(windows.kinetic + windows.gravity)
        residual = windows.residual
        self.residual.take(residual)
        self.effort.take(windows.effort)
        self.needed.take(residual + windows.effort)
        self.weightless.take(residual - windows.gravity)
        self.joints.take(windows.gained - windows.explained)

    def add(self, other):
        """Take in what another one has."""
        for name in ("kinetic", "total", "residual", "effort", "needed", "weightless", "joints"):
            getattr(self, name).add(getattr(other, name))

    @property
    def explained(self):
        """1 − var(residual) / var(dK/dt); None without windows enough, or at rest."""
        return self._share(self.kinetic)

    @property
    def explained_total(self):
        """1 − var(residual) / var(d(K + U)/dt); None without windows enough, or at rest."""
        return self._share(self.total)

    def _share(self, moments):
        if not self._is_judged():
            return None
        return explained_share(self.residual.variance, moments.variance)

    def _is_judged(self):
        """Return whether there are windows enough of a robot in motion, of any size."""
        if self.moved is None:
            return is_judged(self.kinetic.count, self.kinetic.square)
        return self.moved and self.kinetic.count >= LEAST

    @property
    def residual_power(self):
        """Root mean square of the residual [W]; None without windows enough."""
        return float(np.sqrt(self.residual.square)) if self.residual.count >= LEAST else None

    def of_joints(self):
        """Root mean square of each joint's residual [W], and its share of the sum of all squares, by name."""
        squares = self.joints.square
        total = squares.sum() or 1.0
        return {
            name: (float(np.sqrt(square)), float(square / total))
            for name, square in zip(self._names, squares, strict=True)
        }

    def cause(self):
        """Return a likely cause by the powers of all joints together, in words; empty where they show none."""
        names = "residual", "effort", "needed", "kinetic", "weightless"
        return likely_cause(Variances(*(getattr(self, name).variance for name in names)))

    def judgement(self, cause="", instead=False):
        """What the balance says, in words, or why it says nothing.

        Parameters
        ----------
        cause : str
            Likely one by the efforts of joints.
        instead : bool
            Whether it takes the place of the one that powers show.
        """
        explained, count = self.explained, self.kinetic.count
        if explained is None:
            if count >= LEAST:
                how = f"dK/dt is less than {STILL:g} W rms" if self.moved is None else "no joint moves"
                return f"the robot is at rest, or nearly so: {how}"
            return (
                f"there are {count} windows of {WINDOW:g} s, of at least {LEAST}, in which all states have efforts and are "
                f"no more than {MAX_GAP:g} s apart"
            )
        culprits = culprits_of(self._names, self.joints.square)
        shown = "" if instead else self.cause()
        return judgement(explained, self.explained_total, culprits, "; ".join(filter(None, (shown, cause))))
