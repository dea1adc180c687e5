# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Balance of power: the share of the change of energy that the model and the efforts explain."""

from typing import NamedTuple

import numpy as np

from diag_dynamics.joint_states.stamps import SECOND
from diag_dynamics.recordings.windows import SampleChain, WindowIntegrals

WINDOW, MAX_GAP = 0.1, 0.1
"""Length of a window, as noise of velocities spoils shorter ones, and longest interval that is
integrated over [s]."""

# Fewest windows of an explained share; least rms of dK/dt of the monitor [W]
MIN_WINDOWS, MIN_POWER = 20, 1e-3
NOTHING_EXPLAINED, MIN_EXPLAINED = 0.3, 0.8
"""Explained shares below which the balance explains nothing, and too little."""

# Time before and after an alarm [s]; largest fraction of windows near alarms
AROUND, MAX_TOUCHED = 0.2, 0.5


class Windows(NamedTuple):
    """Windows that ended in a batch of states.

    Stamps are in ns, mean powers in W, shape (W,) each.
    """

    begin: np.ndarray
    end: np.ndarray
    kinetic: np.ndarray  # dK/dt
    effort: np.ndarray  # νᵀε
    gravity: np.ndarray  # νᵀε_g, the rate of potential energy
    friction: np.ndarray  # νᵀε_fric

    @property
    def residual(self):
        """dK/dt less the power of efforts, gravity and friction, shape (W,)."""
        return self.kinetic - (self.effort - self.gravity - self.friction)


class Balance:
    """Balance of power over windows, by the trapezoidal rule, batch by batch.

    C does no work on K (Lemma 7.2). `moved` is whether the robot has moved.
    """

    def __init__(self, friction=False):
        self.moved = True
        self._friction = friction
        self._chain = SampleChain(MAX_GAP)
        self._integrals = WindowIntegrals(WINDOW)
        # Stamp, powers and K of the last sample.
        self._last = 0, np.zeros(3), np.zeros(1)
        empty = np.zeros((2, 0), np.int64)
        self._parts = [Windows(*empty, *np.zeros((4, 0)))]

    def add_states(self, states, s):
        """Add the windows that end at states, given their Evaluation."""
        samples = self._chain.select(states)
        rows = samples.rows
        stamp, power, energy = self._last
        nu = s.nu[rows]
        friction = s.friction[rows] if self._friction else np.zeros_like(nu)
        forces = s.epsilon[rows], s.gravity[rows], friction
        powers = [np.einsum("tk,tk->t", nu, force) for force in forces]
        powers = np.vstack([power, np.column_stack(powers)])
        energies = np.vstack([energy, s.kinetic_energy[rows, None]])
        work = 0.5 * samples.interval[:, None] * (powers[:-1] + powers[1:])
        steps = np.vstack([np.zeros_like(power), work])
        stamps = np.append(stamp, states.stamp[rows])
        self._last = stamps[-1], powers[-1], energies[-1]
        follows = np.append(False, samples.interval > 0.0)
        begin, end, work, gained = self._integrals.integrate(stamps, follows, steps, energies)
        span = (end - begin) / SECOND
        self.add_windows(Windows(begin, end, gained[:, 0] / span, *(work.T / span)))

    def add_windows(self, windows):
        """Add :class:`Windows`."""
        self._parts.append(windows)

    @property
    def windows(self):
        """All :class:`Windows`."""
        return Windows(*map(np.concatenate, zip(*self._parts, strict=True)))

    @property
    def count(self):
        """Number of windows."""
        return len(self.windows.begin)

    @property
    def explained(self):
        """1 − var(residual) / var(dK/dt); None with too few windows, or at rest."""
        return self._explained_share(self.windows.kinetic)

    @property
    def explained_total(self):
        """1 − var(residual) / var(d(K + U)/dt); None with too few windows, or at rest."""
        return self._explained_share(self.windows.kinetic + self.windows.gravity)

    def _explained_share(self, change):
        if self.count < MIN_WINDOWS or not self.moved:
            return None
        return explained_share(self.windows.residual.var(), change.var())

    def is_explained_beside(self, collisions):
        """Return whether efforts explain enough outside of collisions.

        Collisions last for less than half of the time then.
        """
        if not collisions or self.explained is None:
            return False
        windows = self.windows
        margin = round(AROUND * SECOND)
        touched = np.zeros(self.count, bool)
        for alarm in collisions:
            touched |= (windows.end > alarm.start - margin) & (windows.begin < alarm.end + margin)
        left = np.square(windows.residual[~touched]).sum()
        share = explained_share(left / self.count, windows.kinetic.var())
        return bool(touched.mean() < MAX_TOUCHED and share >= MIN_EXPLAINED)

    @property
    def residual_power(self):
        """Root mean square of the residual [W]; None with too few windows."""
        if self.count < MIN_WINDOWS:
            return None
        return float(np.sqrt(np.square(self.windows.residual).mean()))

    def summary(self, fault, is_beside, partial):
        """Return the number of windows, and the judgement with the likely fault of efforts.

        `is_beside` tells whether efforts explain enough outside of collisions. `partial` are the
        only joints that are judged; the efforts of others are the model's.
        """
        text = "collisions explain the rest: no effort contains their power"
        return {
            "windows": self.count,
            "length": WINDOW,
            "text": text if is_beside else self._judgement(fault),
            "explained_beside_collisions": is_beside,
            "moved": self.moved,
            "partial": partial,
        }

    def _judgement(self, fault):
        """Return the judgement in words, with the likely fault of the efforts."""
        explained = self.explained
        total = self.explained_total
        if self.count < MIN_WINDOWS:
            return (
                f"{self.count} windows of {WINDOW:g} s have efforts and no gap above {MAX_GAP:g} "
                f"s; expected at least {MIN_WINDOWS}"
            )
        if explained is None:
            return "no joint moves by more than a push moves a robot that stands"
        if explained >= MIN_EXPLAINED:
            return f"the efforts explain {explained:.0%} of the change of kinetic energy"
        remedy = f"{fault}; " if fault else ""
        remedy += "check unit of the efforts, friction, rotor inertias and payload "
        remedy += "(docs/recordings.md)"
        if total is not None and total >= MIN_EXPLAINED and explained < NOTHING_EXPLAINED:
            return (
                "the residual exceeds the change of kinetic energy; the efforts explain "
                f"{total:.0%} of the change of "
                f"kinetic and potential energy. To improve this, {remedy}"
            )
        share = max(0.0, explained)
        return f"the efforts explain only {share:.0%} of the change of kinetic energy: {remedy}"


def explained_share(residual, change):
    """Return 1 − var(residual) / var(change) from the two variances; None if nothing changes."""
    return float(1.0 - residual / change) if change > 0.0 else None
