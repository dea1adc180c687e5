# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Balance of power: the share of the change of energy that the model and the efforts explain."""

from typing import NamedTuple

import numpy as np

from diag_dynamics.assembly.stamps import SECOND
from diag_dynamics.recordings.windows import SampleChain, WindowIntegrals

WINDOW = 0.1
"""Length of a window [s]: noise of velocities spoils shorter ones, longer ones average errors away."""

MAX_GAP = 0.1
"""Longest interval between states of a window [s]."""

MIN_WINDOWS, MIN_POWER = 20, 1e-3
"""Fewest windows, and smallest root mean square of dK/dt [W], that are judged."""

NOTHING_EXPLAINED, MIN_EXPLAINED = 0.3, 0.8
"""Explained shares below which the balance explains nothing, and too little."""

FAULT_SHARE = 0.2
"""Share of the sum of all joints' squared residuals from which a joint is named."""

CORRELATION, NO_FACTOR = 0.9, 1.5
"""Squared correlation of effort power and required power of a factor; factors up to this are none."""


class Windows(NamedTuple):
    """Windows that ended in a batch of states: stamps [ns], shape (W,), and mean powers [W], shapes (W,) and (W, nv)."""

    begin: np.ndarray
    end: np.ndarray
    kinetic: np.ndarray  # dK/dt
    effort: np.ndarray  # νᵀε
    gravity: np.ndarray  # νᵀε_g, the rate of potential energy
    friction: np.ndarray  # νᵀε_fric
    gained: np.ndarray  # change of ½ν_k²
    explained: np.ndarray  # ν_k(ε_k − C_k − ε_g,k − ε_fric,k)

    @property
    def residual(self):
        """dK/dt less the power of efforts, gravity and friction, shape (W,)."""
        return self.kinetic - (self.effort - self.gravity - self.friction)


class WindowSums:
    """Integrate powers over windows by the trapezoidal rule, batch by batch; C does no work on K (Lemma 7.2)."""

    def __init__(self, count, friction=False):
        self._friction = friction
        self._chain, self._integrals = SampleChain(MAX_GAP), WindowIntegrals(WINDOW)
        self._last = 0, np.zeros(3 + count), np.zeros(count)  # stamp, powers and ½ν² of the last sample

    def take(self, states, s):
        """Return the :class:`Windows` that end at states, given their BatchEvaluation."""
        samples = self._chain.select(states)
        rows, (stamp, power, share) = samples.rows, self._last
        nu, epsilon, gravity = s.nu[rows], s.epsilon[rows], s.gravity[rows]
        resisting = s.coriolis[rows] + gravity
        powers = np.empty((len(nu) + 1, len(power)))
        powers[0], powers[1:, 2] = power, 0.0
        np.einsum("tk,tk->t", nu, epsilon, out=powers[1:, 0])
        np.einsum("tk,tk->t", nu, gravity, out=powers[1:, 1])
        if self._friction:
            np.einsum("tk,tk->t", nu, s.friction[rows], out=powers[1:, 2])
            resisting += s.friction[rows]
        np.multiply(nu, epsilon - resisting, out=powers[1:, 3:])
        shares = np.vstack([share, 0.5 * nu * nu])
        steps = np.empty_like(powers)
        np.multiply(0.5 * samples.interval[:, None], powers[:-1] + powers[1:], out=steps[1:])
        stamps = np.append(stamp, states.stamp[rows])
        self._last = stamps[-1], powers[-1], shares[-1]
        follows = np.append(False, samples.interval > 0.0)
        begin, end, work, gained = self._integrals.integrate(stamps, follows, steps, shares)
        span = ((end - begin) / SECOND)[:, None]
        gained, work = gained / span, work / span
        return Windows(begin, end, gained.sum(axis=1), *work[:, :3].T, gained, work[:, 3:])


class Moments:
    """Count, mean and variance of columns of values that come in batches (Chan, Golub and LeVeque 1983)."""

    def __init__(self, columns):
        self.count, self.mean, self.squares = 0, np.zeros(columns), np.zeros(columns)

    def add_values(self, values):
        """Add values, shape (T, columns)."""
        if not len(values):
            return
        count, mean = len(values), values.mean(axis=0)
        apart, total = mean - self.mean, self.count + count
        self.squares = self.squares + ((values - mean) ** 2).sum(axis=0) + apart**2 * (self.count * count / total)
        self.mean, self.count = self.mean + apart * (count / total), total

    @property
    def variance(self):
        """Mean squared distance from the mean; 0 without values."""
        return self.squares / max(self.count, 1)

    @property
    def square(self):
        """Mean of the squares."""
        return self.variance + self.mean**2


POWERS = "kinetic", "total", "residual", "effort", "needed", "weightless"
"""Powers whose variances are judged: dK/dt, d(K + U)/dt, the residual, νᵀε, dK/dt + νᵀ(ε_g + ε_fric), and the residual of
efforts without gravity, dK/dt + νᵀ(ε_fric − ε)."""


class Balance:
    """Judge windows of a robot with these degrees of freedom; `moved` tells whether any joint moves, if that is known."""

    def __init__(self, names):
        self._names, self.moved = tuple(names), None
        self.moments = Moments(len(POWERS) + len(names))

    def take(self, windows):
        """Add :class:`Windows`."""
        kinetic, residual, effort, gravity = windows.kinetic, windows.residual, windows.effort, windows.gravity
        powers = kinetic, kinetic + gravity, residual, effort, residual + effort, residual - gravity
        self.moments.add_values(np.column_stack([*powers, windows.gained - windows.explained]))

    def _of(self, numbers):
        return dict(zip(POWERS, numbers.tolist(), strict=False))

    @property
    def _squares(self):
        return self.moments.square[len(POWERS) :]

    @property
    def explained(self):
        """1 − var(residual) / var(dK/dt); None with too few windows, or at rest."""
        return self._share("kinetic")

    @property
    def explained_total(self):
        """1 − var(residual) / var(d(K + U)/dt); None with too few windows, or at rest."""
        return self._share("total")

    def _share(self, change):
        count, variances = self.moments.count, self._of(self.moments.variance)
        judged = count >= MIN_WINDOWS and self.moved
        if self.moved is None:
            judged = is_judged(count, self._of(self.moments.square)["kinetic"])
        return explained_share(variances["residual"], variances[change]) if judged else None

    @property
    def residual_power(self):
        """Root mean square of the residual [W]; None with too few windows."""
        square = self._of(self.moments.square)["residual"]
        return float(np.sqrt(square)) if self.moments.count >= MIN_WINDOWS else None

    def of_joints(self):
        """Return each joint's root mean square residual [W] and its share of all squares, by name."""
        squares = self._squares
        shares = squares / (squares.sum() or 1.0)
        return dict(zip(self._names, zip(np.sqrt(squares).tolist(), shares.tolist(), strict=True), strict=True))

    def cause(self):
        """Return a likely cause by the powers of all joints together, in words; or an empty text."""
        variances = self._of(self.moments.variance)
        del variances["total"]
        return likely_cause(**variances)

    def judgement(self, cause="", instead=False):
        """Return the judgement in words; a cause by the efforts of joints stands beside or instead of that by powers."""
        explained, count = self.explained, self.moments.count
        if explained is not None:
            culprits = culprits_of(self._names, self._squares)
            causes = "; ".join(filter(None, ("" if instead else self.cause(), cause)))
            return judgement(explained, self.explained_total, culprits, causes)
        if count >= MIN_WINDOWS:
            how = f"dK/dt is less than {MIN_POWER:g} W rms" if self.moved is None else "no joint moves"
            return f"the robot is at rest, or nearly so: {how}"
        return (
            f"there are {count} windows of {WINDOW:g} s, of at least {MIN_WINDOWS}, in which all states "
            f"have efforts and are no more than {MAX_GAP:g} s apart"
        )


def is_judged(count, square):
    """Return whether so many windows are judged, given the mean square of dK/dt [W²]."""
    return count >= MIN_WINDOWS and square >= MIN_POWER**2


def explained_share(residual, change):
    """Return 1 − var(residual) / var(change) from the two variances; None if nothing changes."""
    return float(1.0 - residual / change) if change > 0.0 else None


def culprits_of(names, squares):
    """Return the joints with most of the residual, by the mean squares of their residuals."""
    total = sum(squares) or 1.0
    return [name for name, one in zip(names, squares, strict=True) if one / total >= FAULT_SHARE]


def likely_cause(residual, effort, needed, kinetic, weightless):
    """Return gravity, or a factor of all efforts, if it explains the motion, in words, by variances of POWERS [W²]."""
    if kinetic > 0.0 and 1.0 - weightless / kinetic >= MIN_EXPLAINED:
        return "gravity seems not to be in the efforts (effort_includes_gravity)"
    together = 0.5 * (needed + effort - residual)
    if effort * needed <= 0.0 or together**2 < CORRELATION * effort * needed:
        return ""
    factor = together / effort
    is_one = 1.0 / NO_FACTOR < abs(factor) < NO_FACTOR
    if factor < 0.0:
        whose = "the efforts" if is_one else "efforts of some joints"
        return f"{whose} seem to have the wrong sign: times {factor:.3g} all are what is needed"
    return "" if is_one else f"the efforts seem to have another unit: times {factor:.3g} all are what is needed"


def judgement(explained, total, culprits=(), cause=""):
    """Return the judgement of explained shares of dK/dt and of d(K + U)/dt in words; empty if they are None."""
    if explained is None:
        return ""
    if explained >= MIN_EXPLAINED:
        return f"the efforts explain {explained:.0%} of the change of kinetic energy"
    remedy = "check the unit of efforts, friction, rotor inertias, payload (docs/recordings.md)"
    remedy = f"{cause}; {remedy}" if cause else remedy
    where = f"; most of what is missing is at {', '.join(culprits)}" if culprits else ""
    if total is not None and total >= MIN_EXPLAINED and explained < NOTHING_EXPLAINED:
        return (
            f"kinetic energy changes less than what is not explained; of kinetic and potential energy "
            f"together the efforts explain {total:.0%}: for more, {remedy}"
        )
    if explained >= NOTHING_EXPLAINED:
        return f"the efforts explain only {explained:.0%} of the change of kinetic energy: {remedy}{where}"
    return f"the balance explains nothing ({explained:.3g}): {remedy}{where}"
