"""Balance of power as a judgement: how much of the change of energy the model and the efforts explain."""

from typing import NamedTuple

import numpy as np

from diag_dynamics.compiled.tables import Addresses
from diag_dynamics.recordings.explained import LEAST, MAX_GAP, WINDOW, explained_share, judgement
from diag_dynamics.recordings.kernels import prepare
from diag_dynamics.recordings.kernels.balance import BALANCE, COLUMNS, SUMMED, sum_windows

CULPRIT = 0.2
"""Share of the sum of all joints' squared residuals from which a joint is named."""


class Windows(NamedTuple):
    """Windows that ended in a piece; powers are means over each [W]."""

    begin: np.ndarray
    """[s], shape (W,)."""
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

    def __init__(self, shape=()):
        self.count, self.mean, self._squares = 0, np.zeros(shape), np.zeros(shape)

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

    def add(self, other):
        """Take in what another one has."""
        if not other.count:
            return
        apart, total = other.mean - self.mean, self.count + other.count
        self._squares = self._squares + other._squares + apart**2 * (self.count * other.count / total)
        self.mean = self.mean + apart * (other.count / total)
        self.count = total


class Balance:
    """Sums powers over windows, piece by piece, and judges them.

    Parameters
    ----------
    names : sequence of str
        Degrees of freedom.
    friction : bool
        Whether evaluations have it.
    length : float
        Of a window [s].
    max_gap : float
        Time without states beyond which a window begins anew [s].
    """

    def __init__(self, names, friction=False, length=WINDOW, max_gap=MAX_GAP):
        self._names, self._friction, self._length, self._max_gap = names, friction, length, max_gap
        count = len(names)
        self._own = Addresses(
            BALANCE,
            flags=np.zeros(2, dtype=int),
            time=np.zeros(2),
            before=np.zeros(count),
            powers=np.zeros(3),
            begun=np.zeros(count),
            work=np.zeros((2, max(count, 3))),
        )
        self._origin = None
        self.kinetic, self.total, self.residual = Moments(), Moments(), Moments()
        self.joints = Moments(count)
        prepare(sum_windows)

    def take(self, states, s):
        """Take in states and their BatchEvaluation; returns :class:`Windows`."""
        count, width = s.nu.shape
        if self._origin is None and count:
            self._origin = int(states.newest[0])
        time = 1e-9 * (states.newest - (self._origin or 0))
        most = self._most(time)
        windows, joints = np.empty((most, len(COLUMNS))), np.empty((2, most, width))
        summed = Addresses(
            SUMMED,
            time=time,
            with_effort=np.ascontiguousarray(states.with_effort),
            moved=np.ascontiguousarray(states.moved),
            nu=s.nu,
            coriolis=s.coriolis,
            gravity=s.gravity,
            epsilon=s.epsilon,
            friction=s.friction if self._friction else np.zeros((0, width)),
            windows=windows,
            gained=joints[0],
            explained=joints[1],
        )
        ended = sum_windows(self._own.at, summed.at, self._length, self._max_gap)
        begin, end, *powers = windows[:ended].T
        offset = 1e-9 * (self._origin or 0)
        found = Windows(begin + offset, end + offset, *powers, *joints[:, :ended])
        self.kinetic.take(found.kinetic)
        self.total.take(found.kinetic + found.gravity)
        self.residual.take(found.residual)
        self.joints.take(found.gained - found.explained)
        return found

    def _most(self, time):
        """How many windows can end: each is no shorter than the length, one apart that began in an earlier piece."""
        if not len(time):
            return 0
        forward = np.maximum(np.diff(time), 0.0).sum()
        return min(len(time), int(forward / self._length) + 2)

    @property
    def explained(self):
        """1 − var(residual) / var(dK/dt); None without windows enough."""
        return self._share(self.kinetic)

    @property
    def explained_total(self):
        """1 − var(residual) / var(d(K + U)/dt); None without windows enough."""
        return self._share(self.total)

    def _share(self, moments):
        return explained_share(self.residual.variance, moments.variance, moments.count)

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

    def judgement(self):
        """What the balance says, in words; empty without windows enough."""
        explained = self.explained
        culprits = [name for name, (_, share) in self.of_joints().items() if share >= CULPRIT]
        return judgement(explained, self.explained_total, culprits)
