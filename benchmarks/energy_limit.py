# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""How well sampled loops of ten arms keep a limit of kinetic energy, with limits of efforts and of their rates.

`python benchmarks/run.py --only energy` in the sourced environment writes energy_limit.md into results. The plant is
Pinocchio by Runge–Kutta steps, which shares no code with the limiter. Everything is simulated, from fixed seeds.
"""

import re
from functools import cache

import numpy as np
import pinocchio as pin

import diag_dynamics as dd
from diag_dynamics.description.catalog import find_urdf
from diag_dynamics.exceptions import InputError

ARMS = {  # robot, and the start of the names of its joints that move
    "UR5": ("ur5_robot", ""),
    "UR10": ("ur10_robot", ""),
    "Panda": ("panda", "panda_joint"),
    "xArm 7": ("xarm7", "joint"),
    "Kinova": ("kinova", ""),
    "z1": ("z1", "joint[1-6]"),
    "Baxter arm": ("baxter", "left_[sew]"),
    "TIAGo arm": ("tiago_no_hand", "arm_"),
    "Talos arm": ("talos_left_arm", "arm_left"),
    "Talos arms": ("talos_reduced", "arm_(left|right)"),
}
PERIODS, RATES = (1e-3, 2e-3, 4e-3, 8e-3), (np.inf, 1000.0, 300.0)  # [s], [N m/s]
STEP, SECONDS, ALPHA, FORCE = 5e-4, 1.0, 50.0, 30.0  # [s] of the plant, [s] of a loop, [1/s], [N]
HEAVY = 0.9  # largest weight of a joint relative to its effort limit where a loop begins
KEPT = 1.02  # largest K relative to its limit of a loop that keeps it
COUNTS, SEED = (400, 80), 59  # loops with set-points that jump, and loops that are pushed

INTRODUCTION = f"""Each loop lasts {SECONDS:g} s: two jumps of the set-point up to 1 rad, or a push for the first half.
α is {ALPHA:g} 1/s, K_max 0.1 to 1 J. Effort limits are those of the URDF; efforts begin at gravity compensation. Laws are
`JointRegulation` and `JointTracking` with gains that `require_stable` accepts. K is relative to K_max + P/α with the
largest power P of the push. Loops in which a weight exceeds its effort limit are left out: the joint falls. Arms:
{", ".join(ARMS)}."""


@cache
class Arm:
    """An arm in the library and in Pinocchio; other joints are locked at zero or nearest to it."""

    def __init__(self, label):
        name, moving = ARMS[label]
        every, full = (
            dd.load_robot(name, mimic="free"),
            pin.buildModelFromUrdf(str(find_urdf(name))),
        )
        zero = dict(zip(every.dof_names, np.clip(0.0, every.lower, every.upper), strict=True))
        locked = {x: float(zero[x]) for x in full.names[1:] if not re.match(moving, x)}
        joints, q = [full.getJointId(x) for x in locked], pin.neutral(full)
        for joint, value in zip(joints, locked.values(), strict=True):
            if full.joints[joint].nq == 1:
                q[full.joints[joint].idx_q] = value
        self.rigid = pin.buildReducedModel(full, joints, q)
        self.data, self._neutral = self.rigid.createData(), pin.neutral(self.rigid)
        self.dyn = dd.DiagonalDynamics(dd.load_robot(name, mimic="free", locked_joints=locked))
        if list(self.dyn.model.dof_names) != list(self.rigid.names)[1:]:
            raise SystemExit(f"{label}: joints are {self.dyn.model.dof_names}.")

    def at(self, q):
        """Return model, data and Pinocchio's configuration."""
        return self.rigid, self.data, pin.integrate(self.rigid, self._neutral, q)

    def jacobian(self, q):
        """Return that of the last joint's origin, three rows."""
        pin.computeJointJacobians(*self.at(q))
        last, axes = self.rigid.njoints - 1, pin.LOCAL_WORLD_ALIGNED
        return pin.getJointJacobian(self.rigid, self.data, last, axes)[:3]

    def after(self, q, qd, tau, period):
        """Return the state after a period of constant efforts."""
        count = round(period / STEP)
        h = period / count
        for _ in range(count):
            a = pin.aba(*self.at(q), qd, tau)
            b = pin.aba(*self.at(q + 0.5 * h * qd), qd + 0.5 * h * a, tau)
            c = pin.aba(*self.at(q + 0.5 * h * qd + 0.25 * h * h * a), qd + 0.5 * h * b, tau)
            d = pin.aba(*self.at(q + h * qd + 0.5 * h * h * b), qd + h * c, tau)
            q = q + h * qd + h * h / 6.0 * (a + b + c)
            qd = qd + h / 6.0 * (a + 2.0 * b + 2.0 * c + d)
        return q, qd


class Loop:
    """A random loop that `require_stable` accepts, the same for the same seeds."""

    def __init__(self, number, pushed=False, seed=SEED):
        rng, self.pushed = np.random.default_rng([seed, number, pushed]), pushed
        while True:
            self.label = str(rng.choice(list(ARMS)))
            self.arm = Arm(self.label)
            dyn, model = self.arm.dyn, self.arm.dyn.model
            self.period, self.limit = (
                float(rng.choice(PERIODS)),
                float(10 ** rng.uniform(-1.0, 0.0)),
            )
            self.rate = 1000.0 if pushed else RATES[int(rng.integers(len(RATES)))]
            self.q = rng.uniform(np.maximum(model.lower, -2.0), np.minimum(model.upper, 2.0))
            self.goals = self.q + (not pushed) * rng.uniform(-1.0, 1.0, (2, model.nv))
            force = rng.normal(size=3)
            self.force = pushed * FORCE * force / np.linalg.norm(force)
            self.gain, ratio = float(10 ** rng.uniform(0.5, 2.8)), rng.uniform(0.5, 1.5)
            law = dd.JointRegulation(dyn, self.gain, ratio)
            if rng.random() < 0.4:
                law = dd.JointTracking(dyn, 0.2 * self.gain, 0.1 * self.gain)
            self.law, weight = law, np.abs(pin.computeGeneralizedGravity(*self.arm.at(self.q)))
            try:
                law.require_stable(self.q, self.period)
            except InputError:
                continue
            if (weight < HEAVY * model.effort_limit).all():
                return

    def run(self, seconds=SECONDS):
        """Return the largest K relative to K_max + P/α, with the largest power P of a push, and the largest weight."""
        arm, q, qd, power, energy, weight = self.arm, self.q, 0.0 * self.q, 0.0, 0.0, 0.0
        options = {"energy_limit": self.limit, "energy_rate": ALPHA}
        limits = dd.Limits(arm.dyn, effort_rate=min(self.rate, 1e9), **options)
        count = round(seconds / self.period)
        for k in range(count):
            command = self.law.command(q, qd, self.goals[2 * k // count])
            push = (2 * k < count) * arm.jacobian(q).T @ self.force
            effort = limits.filter(q, qd, command, self.period).effort
            q, qd = arm.after(q, qd, effort + push, self.period)
            power = max(power, float(push @ qd))
            energy = max(energy, pin.computeKineticEnergy(*arm.at(q), qd))
            weight = max(weight, *np.abs(command.gravity_torque) / arm.dyn.model.effort_limit)
        return energy / (self.limit + power / ALPHA), weight

    def __str__(self):
        kind = "K_q" if isinstance(self.law, dd.JointRegulation) else "tracking"
        return f"{self.label}, {1e3 * self.period:g} ms, {kind} {self.gain:.0f}, {self.limit:.2f} J"


def compare(short):
    """Return the largest relative K, weight and loop of each run by (pushed, rate); of a few if short."""
    found = {}
    for pushed, count in zip((False, True), (9, 3) if short else COUNTS, strict=True):
        for number in range(count):
            loop = Loop(number, pushed)
            result = *loop.run(0.05 if short else SECONDS), str(loop)
            found.setdefault((pushed, loop.rate), []).append(result)
    return dict(sorted(found.items(), key=lambda one: (one[0][0], -one[0][1])))


def table(found):
    """Return the results as lines of text."""
    lines = [INTRODUCTION, "", f"| loops | R | number | largest K | above {KEPT:g} | next |"]
    lines.append("|---|---|---|---|---|---|")
    for (pushed, rate), rows in found.items():
        rows = sorted((row for row in rows if row[1] <= 1.0), reverse=True)
        above = sum(row[0] > KEPT for row in rows)
        next_ones = (f"{row[0]:.3f} ({row[2]})" for row in rows[1 : max(above, 3)])
        cells = (
            f"pushed by {FORCE:g} N" if pushed else "set-points that jump",
            "none" if rate == np.inf else f"{rate:g} N m/s",
            len(rows),
            f"{rows[0][0]:.4f} ({rows[0][2]})",
            above,
            ", ".join(next_ones),
        )
        lines.append(f"| {' | '.join(map(str, cells))} |")
    return lines
