# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What bounding contacts costs in tracking, beside a bound on all of the kinetic energy that keeps the same limits.

`python benchmarks/run.py --only contact` in the sourced environment writes contact_limit.md into results. Everything is
simulated, from a fixed seed; only the time of a cycle depends on the machine.
"""

import time
from typing import NamedTuple

import numpy as np

import diag_dynamics as dd
from diag_dynamics.description.catalog import find_urdf

PERIOD, DURATION, RATE = 1e-3, 3.0, 30.0  # [s], [s], [1/s]
FINGERS = dict.fromkeys(("panda_finger_joint1", "panda_finger_joint2"), 0.0)


class Case(NamedTuple):
    """A robot and a limit, of nobody's body."""

    what: str
    robot: str
    limit: dict
    locked_joints: dict

    def __hash__(self):
        return hash(self.what)


CASES = (
    Case("Panda, transferable energy up to 0.3 J", "panda", {"energy": 0.3}, FINGERS),
    Case(
        "Panda, up to 100 N against 0.6 kg behind 75 kN/m",
        "panda",
        {"mass": 0.6, "stiffness": 75e3, "force": 100.0},
        FINGERS,
    ),
    Case("Baxter, both arms, transferable energy up to 0.6 J", "baxter", {"energy": 0.6}, {}),
)


class Outcome(NamedTuple):
    """Of motions under one limiter: what it kept, and what it cost."""

    usage: float  # largest part of an allowed speed
    late: float  # rms of the tracking error [rad]
    largest: float  # largest tracking error [rad]
    torque: float  # rms of what the limiter changed in the efforts [N m]
    cycle: float  # median CPU time of the limiter [s]


class Motions:
    """Swings of all joints of a robot for some time [s], tracked, at paces that break the limit in parts of them."""

    def __init__(self, case, duration=DURATION):
        self.duration = duration
        path = find_urdf(case.robot)
        self.model = dd.load_urdf(path, locked_joints=case.locked_joints)
        self.dyn = dd.DiagonalDynamics(self.model)
        limits = dd.ContactLimits({"any": case.limit})
        self.points = dd.ContactPoints(
            self.model, dd.link_geometry(self.model, path, "frames").points, limits, "limit"
        )

    def goal(self, rng):
        """Where a swing should be, and how it should move, as functions of time."""
        model, n = self.model, self.model.nv
        centre = np.clip(0.5 * (model.lower + model.upper), -2, 2)
        size, pace, phase = (
            0.4 * rng.uniform(0.5, 1, n),
            rng.uniform(0.8, 2.4, n),
            rng.uniform(0, 6, n),
        )

        def at(t):
            angle = pace * t + phase
            return (
                centre + size * np.sin(angle),
                size * pace * np.cos(angle),
                -size * pace**2 * np.sin(angle),
            )

        return at

    def run(self, seeds, kind, bound=None):
        """Outcome under no limiter, the contact limiter, or a bound on K [J], alone or with rates of efforts."""
        usages, errors, changes, times = [], [], [], []
        nothing = np.zeros(self.model.nv)
        for seed in seeds:
            goal, law = (
                self.goal(np.random.default_rng(seed)),
                dd.JointTracking(self.dyn, 20.0, 10.0),
            )
            contact = dd.ContactLimiter(self.dyn, self.points, RATE)
            energy = dd.EnergyLimiter(self.dyn, bound or 1.0, rate=RATE)
            q, qd, _ = goal(0.0)
            limits = dd.Limits(
                self.dyn,
                energy_limit=bound or 1.0,
                energy_rate=RATE,
                effort_limit=np.full(self.model.nv, np.inf),
            )
            options = {
                "step": PERIOD,
                "limits": False,
                "effort_limits": False,
                "damping": nothing,
                "friction": nothing,
            }
            plant = dd.Simulation(self.model, q, 0.1 * qd, **options)
            for k in range(int(self.duration / PERIOD)):
                q, qd = plant.q, plant.qd
                command = asked = law.command(q, qd, *goal(k * PERIOD))
                begun = time.thread_time()
                if kind == "contact":
                    command = contact.filter(q, qd, asked, PERIOD)
                elif kind == "energy":
                    command = energy.filter(q, qd, asked, PERIOD)
                elif kind == "limits":
                    command = asked._replace(tau=limits.filter(q, qd, asked, PERIOD).effort)
                times.append(time.thread_time() - begun)
                usages.append(self.dyn.contact_limits(q, qd, self.points).usage.max())
                errors.append(asked.error)
                changes.append(command.tau - asked.tau)
                plant.advance(command.tau)
        rms = [float(np.sqrt(np.mean(np.square(x)))) for x in (errors, changes)]
        return Outcome(
            float(max(usages)), rms[0], float(np.abs(errors).max()), rms[1], float(np.median(times))
        )

    def bound_of_all(self, seeds):
        """Largest bound on K with which these motions keep the same limit, to a twentieth [J]."""
        low, high = 0.01, 10.0
        while high > 1.05 * low:
            middle = np.sqrt(low * high)
            if self.run(seeds, "energy", middle).usage <= 1.0:
                low = middle
            else:
                high = middle
        return low


def compare(short):
    """Outcomes of each case, by what limits; short: of one case, one motion of a tenth of the time."""
    if short:
        return {CASES[0]: measure(CASES[0], 1, 0.1 * DURATION)}
    return {case: measure(case, 2) for case in CASES}


def measure(case, count, duration=DURATION):
    """Outcomes of one case, and the bound on K."""
    motions, seeds = Motions(case, duration), range(count)
    bound = motions.bound_of_all(seeds)
    return {
        "nothing": motions.run(seeds, "none"),
        "`ContactLimiter`": motions.run(seeds, "contact"),
        f"`EnergyLimiter` with the K that keeps it, {bound:.2f} J": motions.run(
            seeds, "energy", bound
        ),
        "`Limits` with this K, 1000 N m/s": motions.run(seeds, "limits", bound),
    }


def table(found):
    """The results as lines of text."""
    lines = [
        f"All joints swing, tracked at {1 / PERIOD:g} Hz; contact at the frames of all links. No effort limits.",
        "",
    ]
    for case, outcomes in found.items():
        lines += [
            f"## {case.what}",
            "",
            "| bounded by | largest part of the allowed speed | error, rms | largest | change of efforts, rms | CPU time |",
            "|---|---|---|---|---|---|",
            *(_row(name, one) for name, one in outcomes.items()),
            "",
        ]
    return lines


def _row(name, one):
    cells = (
        name,
        f"{one.usage:.3f}",
        f"{one.late:.3f} rad",
        f"{one.largest:.2f} rad",
        f"{one.torque:.1f} N m",
        f"{1e6 * one.cycle:.0f} µs",
    )
    return f"| {' | '.join(cells)} |"
