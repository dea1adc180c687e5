# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Balance of power: the share of the change of energy that the model and the efforts explain."""

from typing import NamedTuple

import numpy as np

from diag_dynamics.assembly.stamps import SECOND
from diag_dynamics.recordings.windows import SampleChain, WindowIntegrals

WINDOW, MAX_GAP = 0.1, 0.1
"""Length of a window, and longest interval between its states [s]: noise of velocities spoils shorter ones."""

MIN_WINDOWS, MIN_POWER = 20, 1e-3  # fewest windows, and least root mean square of dK/dt [W], of an explained share
NOTHING_EXPLAINED, MIN_EXPLAINED = 0.3, 0.8
"""Explained shares below which the balance explains nothing, and too little."""

FAULT_SHARE = 0.2  # share of the sum of all joints' squared residuals from which a joint is named
CORRELATION, NO_FACTOR = 0.9, 1.5
"""Squared correlation of effort power and required power of a factor; factors up to this are none."""

POWERS = "kinetic", "total", "residual", "effort", "needed", "weightless"
"""Powers whose variances are judged: dK/dt, d(K + U)/dt, the residual, νᵀε, dK/dt + νᵀ(ε_g + ε_fric), and the residual of
efforts without gravity, dK/dt + νᵀ(ε_fric − ε)."""


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

    def integrate_states(self, states, s):
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


class Balance:
    """Judge windows of a robot with these degrees of freedom; `moved` tells whether any joint moves, if that is known."""

    def __init__(self, names, moved=None):
        self._names, self.moved = tuple(names), moved
        self.moments = Moments(len(POWERS) + len(names))

    def add_windows(self, windows):
        """Add :class:`Windows`."""
        kinetic, residual, effort, gravity = windows.kinetic, windows.residual, windows.effort, windows.gravity
        powers = kinetic, kinetic + gravity, residual, effort, residual + effort, residual - gravity
        self.moments.add_values(np.column_stack([*powers, windows.gained - windows.explained]))

    @property
    def _variances(self):
        return dict(zip(POWERS, self.moments.variance.tolist(), strict=False))

    @property
    def explained(self):
        """1 − var(residual) / var(dK/dt); None with too few windows, or at rest."""
        return self._explained_share("kinetic")

    @property
    def explained_total(self):
        """1 − var(residual) / var(d(K + U)/dt); None with too few windows, or at rest."""
        return self._explained_share("total")

    def _explained_share(self, change):
        kinetic = self.moments.square[POWERS.index("kinetic")]
        moved = kinetic >= MIN_POWER**2 if self.moved is None else self.moved
        if self.moments.count < MIN_WINDOWS or not moved:
            return None
        return explained_share(self._variances["residual"], self._variances[change])

    @property
    def residual_power(self):
        """Root mean square of the residual [W]; None with too few windows."""
        square = self.moments.square[POWERS.index("residual")]
        return float(np.sqrt(square)) if self.moments.count >= MIN_WINDOWS else None

    @property
    def joints(self):
        """Each joint's root mean square residual `residual_power` [W] and its `share` of all squares, by name."""
        squares = self.moments.square[len(POWERS) :]
        rows = zip(np.sqrt(squares).tolist(), (squares / (squares.sum() or 1.0)).tolist(), strict=True)
        rows = ({"residual_power": rms, "share": share} for rms, share in rows)
        return dict(zip(self._names, rows, strict=True))

    def cause(self):
        """Return gravity, or a factor of all efforts, if it explains the motion, in words; or an empty text."""
        kinetic, _, residual, effort, needed, weightless = self._variances.values()
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

    def judgement(self, cause="", instead=False):
        """Return the judgement in words; a cause by the efforts of joints stands beside or instead of that by powers."""
        explained, total, count = self.explained, self.explained_total, self.moments.count
        if count < MIN_WINDOWS:
            return (
                f"there are {count} windows of {WINDOW:g} s, of at least {MIN_WINDOWS}, in which all states "
                f"have efforts and are no more than {MAX_GAP:g} s apart"
            )
        if explained is None:
            how = f"dK/dt is less than {MIN_POWER:g} W rms" if self.moved is None else "no joint moves"
            return f"the robot is at rest, or nearly so: {how}"
        if explained >= MIN_EXPLAINED:
            return f"the efforts explain {explained:.0%} of the change of kinetic energy"
        causes = filter(None, ("" if instead else self.cause(), cause))
        remedy = "; ".join(
            [*causes, "check the unit of efforts, friction, rotor inertias, payload (docs/recordings.md)"]
        )
        if total is not None and total >= MIN_EXPLAINED and explained < NOTHING_EXPLAINED:
            return (
                f"kinetic energy changes less than what is not explained; of kinetic and potential energy "
                f"together the efforts explain {total:.0%}: for more, {remedy}"
            )
        culprits = ", ".join(name for name, one in self.joints.items() if one["share"] >= FAULT_SHARE)
        where = f"; most of what is missing is at {culprits}" if culprits else ""
        if explained >= NOTHING_EXPLAINED:
            return f"the efforts explain only {explained:.0%} of the change of kinetic energy: {remedy}{where}"
        return f"the balance explains nothing ({explained:.3g}): {remedy}{where}"


def explained_share(residual, change):
    """Return 1 − var(residual) / var(change) from the two variances; None if nothing changes."""
    return float(1.0 - residual / change) if change > 0.0 else None
