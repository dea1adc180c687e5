# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Alarms by an observer that settles on the torque beside those by one that settles on its working moment, calibrated alike.

`make bench ARGS="--only alarms"` writes alarms.md into results.

Real recordings without contact (../shared/recordings) have pushes put into their efforts: on an arm that is held on its way,
a push is what the efforts are short of. One half of a recording calibrates, the other one is pushed. The simulated arm is
pushed indeed, under a tracking law, and has other friction than the observers know of. Another one stops after each motion,
where its friction holds it, and is pushed there or on its way.

Detectors of two sets judge moving and standing arms apart; those of one set judge all states by one set of thresholds.

The first observer is the classical observer (De Luca and Mattone, 2003) in other coordinates: m r is its residual.
"""

import os
import tempfile
import xml.etree.ElementTree as ET
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

import diag_dynamics as dd
from diag_dynamics.collision.calibration import calibrate_residuals, format_rate
from diag_dynamics.collision.detector import AlarmDetector, AlarmThresholds
from diag_dynamics.collision.residuals import Residuals
from diag_dynamics.control.observer import SETTLES_ON
from diag_dynamics.description.catalog import find_urdf
from diag_dynamics.recordings.observer import ObservedStates

RECORDINGS = Path(
    os.environ.get(
        "DIAG_DYNAMICS_RECORDINGS", Path(__file__).resolve().parents[2] / "shared" / "recordings"
    )
)

GAIN, FALSE_ALARMS = 25.0, 1 / 60  # [1/s], the latter of all detectors together
PUSH, LATEST, PAUSE = (
    0.3,
    0.6,
    1.5,
)  # [s]: how long a push lasts, until when it may be seen, between two of them
FORCES = (10.0, 20.0, 40.0)  # [N]
MOTION, PERIOD_OF_STOPS = 3.0, 6.0  # [s]
PUSHED = {
    "standing": (4.0, 5.4),
    "moving": (0.5, 2.2),
}  # when a push begins, after the beginning of a motion [s]
PERIOD = 2e-3  # [s] of the simulated samples
STICTION = 8.0  # ratio of the friction of an arm that stops to that of the other one
KNOWN = 0.8  # part of the simulated friction that the observers know of
VELOCITY_NOISE, EFFORT_NOISE = 2e-3, 0.1  # standard deviations [rad/s], [N m]


class States(NamedTuple):
    """States at stamps [ns]."""

    stamps: np.ndarray
    q: np.ndarray
    qd: np.ndarray
    tau: np.ndarray

    def part(self, which):
        """Some of them."""
        return States(*(column[which] for column in self))


class Robot:
    """A robot as both observers know it."""

    def __init__(self, name, urdf, links, friction=None, **options):
        self.name, self.links = name, links
        self.model = dd.load_urdf(str(urdf), **options)
        self.dyn = dd.DiagonalDynamics(self.model)
        self.friction = (
            friction  # viscous, Coulomb, offset of each joint, taken out of the efforts of both
        )

    def without_friction(self, states):
        """Efforts less those of friction that is known, and of offsets."""
        if self.friction is None:
            return states
        viscous, coulomb, offset = self.friction
        known = viscous * states.qd + coulomb * np.tanh(states.qd / 5e-3) + offset
        return states._replace(tau=states.tau - known)

    def observed(self, states, settles_on):
        """What an observer sees."""
        observer = dd.DisturbanceObserver(self.dyn, GAIN, settles_on=settles_on)
        results = [
            observer.update(1e-9 * (t - states.stamps[0]), *row)
            for t, *row in zip(*states, strict=True)
        ]
        return _observed(
            states, [(x.residual, x.external_torque) if x.valid else None for x in results]
        )


def _observed(states, rows):
    n, valid = states.q.shape[1], np.array([row is not None for row in rows])
    residual, torque = (
        np.array([np.full(n, np.nan) if row is None else row[k] for row in rows]) for k in range(2)
    )
    norm = np.linalg.norm(residual, axis=1)
    return ObservedStates(residual, torque, norm, valid, np.zeros(len(rows), dtype=bool))


OBSERVERS = {x.replace("_", " "): partial(Robot.observed, settles_on=x) for x in SETTLES_ON}


class Push(NamedTuple):
    """A push at a stamp [ns]."""

    at: int
    link: str
    force: np.ndarray


def pushes(rng, robot, stamps, count, force, ats=None):
    """Pushes of a force [N] at random links, in random directions, at random times or those that are given [ns]."""
    if ats is None:
        first, room = stamps[0] + int(1e9), stamps[-1] - stamps[0] - int(3e9)
        ats = first + np.sort(rng.uniform(0, room - count * int(PAUSE * 1e9), count)).astype(int)
        ats += np.arange(count) * int(PAUSE * 1e9)
    directions = rng.normal(size=(count, 3))
    directions *= force / np.linalg.norm(directions, axis=1, keepdims=True)
    return [
        Push(int(at), str(rng.choice(robot.links)), f)
        for at, f in zip(ats, directions, strict=True)
    ]


def shape(passed):
    """Part of the force at a time after the onset [s]: half a sine."""
    return np.sin(np.pi * passed / PUSH) if 0.0 <= passed < PUSH else 0.0


def torque_of(robot, q, push, stamp):
    """Torque of a push."""
    part = shape(1e-9 * (stamp - push.at))
    return (
        robot.dyn.jacobian(q, push.link, frame="world")[:3].T @ (part * push.force)
        if part
        else np.zeros(robot.model.nv)
    )


def pushed(robot, states, given):
    """States as they are measured on an arm that is pushed, but keeps its way."""
    tau = states.tau.copy()
    for push in given:
        inside = np.flatnonzero(
            (states.stamps >= push.at) & (states.stamps < push.at + int(1e9 * PUSH))
        )
        for k in inside.tolist():
            tau[k] -= torque_of(robot, states.q[k], push, states.stamps[k])
    return states._replace(tau=tau)


# --- What is judged


def kuka():
    """The KUKA LWR 4+: friction and offset from the half that calibrates."""
    folder = RECORDINGS / "kuka_lwr4"
    arrays = np.load(folder / "measurements_1.npz")
    states = States(
        np.round(1e9 * arrays["times"]).astype(np.int64),
        *(arrays[name] for name in ("positions", "velocities", "torques")),
    )
    urdf = folder / "kuka_lwr4.urdf"
    links = dd.load_urdf(str(urdf)).link_names
    return _with_friction(Robot("KUKA LWR 4+, recorded", urdf, links[3:]), states)


def panda(folder):
    """The Panda without its hand, friction likewise."""
    rows = np.genfromtxt(
        RECORDINGS / "panda" / "exciting_trajectory.csv.gz", delimiter=",", skip_header=1
    )
    states = States(
        np.round(1e9 * rows[:, 0]).astype(np.int64), rows[:, 1:8], rows[:, 8:15], rows[:, 15:22]
    )
    hand = {"panda_hand", "panda_hand_tcp", "panda_leftfinger", "panda_rightfinger"}
    root = ET.parse(find_urdf("panda")).getroot()
    for part in list(root):
        child = part.find("child")
        if part.get("name") in hand or (child is not None and child.get("link") in hand):
            root.remove(part)
    urdf = folder / "panda.urdf"
    urdf.write_text(ET.tostring(root, encoding="unicode"), encoding="utf-8")
    return _with_friction(Robot("Panda, recorded", urdf, LINKS), states)


LINKS = ("panda_link4", "panda_link5", "panda_link6", "panda_link8")


def _with_friction(robot, states):
    """Viscous and Coulomb friction and offset of each joint, by least squares on efforts filtered at 1 Hz."""
    half = states.part(slice(0, len(states.q) // 2))
    seen, slow = dd.DisturbanceObserver(robot.dyn, 2 * np.pi), np.zeros((3, robot.model.nv))
    rows, last = [], half.stamps[0]
    for stamp, q, qd, tau in zip(*half, strict=True):
        result = seen.update(1e-9 * (stamp - half.stamps[0]), q, qd, tau)
        columns = np.stack([qd, np.tanh(qd / 5e-3), np.ones(len(qd))])
        slow -= np.expm1(-2 * np.pi * 1e-9 * (stamp - last)) * (columns - slow)
        last = stamp
        if result.valid:
            rows.append((slow.copy(), -result.external_torque))
    columns, torque = (np.array(column) for column in zip(*rows, strict=True))
    fitted = [
        np.linalg.lstsq(columns[:, :, k], torque[:, k], rcond=None)[0]
        for k in range(robot.model.nv)
    ]
    robot.friction = tuple(np.array(fitted).T)
    return robot, states


class Sines:
    """Sines of all joints, no two of one period: what comes later is like what came before, and never the same."""

    def __init__(self, model, rng):
        lower, upper, n = np.maximum(model.lower, -2.0), np.minimum(model.upper, 2.0), model.nv
        self.centre, self.pace = 0.5 * (lower + upper), rng.uniform(0.4, 1.5, n)
        self.swing, self.phase = (
            0.25 * (upper - lower) * rng.uniform(0.4, 1, n),
            rng.uniform(0, 2 * np.pi, n),
        )

    def __call__(self, t):
        """Position, velocity and acceleration at a time [s]."""
        angle, size = self.pace * t + self.phase, self.swing * self.pace
        return (
            self.centre + self.swing * np.sin(angle),
            size * np.cos(angle),
            -size * self.pace * np.sin(angle),
        )


class Stops:
    """Motions to random poses of all joints, with a stop after each."""

    def __init__(self, model, rng):
        lower, upper = np.maximum(model.lower, -2.0), np.minimum(model.upper, 2.0)
        self.poses = 0.5 * (lower + upper) + rng.uniform(-0.3, 0.3, (1000, model.nv)) * (
            upper - lower
        )

    def __call__(self, t):
        """Position, velocity and acceleration at a time [s]."""
        k, passed = divmod(t, PERIOD_OF_STOPS)
        first, last = self.poses[int(k)], self.poses[int(k) + 1]
        x = min(passed / MOTION, 1.0)
        shapes = (
            10 * x**3 - 15 * x**4 + 6 * x**5,
            30 * x**2 - 60 * x**3 + 30 * x**4,
            60 * x - 180 * x**2 + 120 * x**3,
        )
        q, qd, qdd = (np.multiply(last - first, one / MOTION**n) for n, one in enumerate(shapes))
        return first + q, qd, qdd


def simulate(robot, true, path, begin, seconds, rng, given=()):
    """A Panda on its path, by a tracking law, pushed indeed; with more friction than its model knows of."""
    model, n = robot.model, robot.model.nv
    viscous, coulomb = true
    law = dd.JointTracking(robot.dyn, 20.0, 10.0)
    plant = dd.Simulation(
        model,
        *path(begin)[:2],
        step=PERIOD,
        damping=viscous,
        friction=coulomb,
        limits=False,
        effort_limits=False,
    )
    rows, given = [], list(given)
    for k in range(int(seconds / PERIOD)):
        stamp = round(k * PERIOD * 1e9)
        q, qd = plant.q, plant.qd + VELOCITY_NOISE * rng.normal(size=n)
        friction = KNOWN * (viscous * qd + coulomb * np.tanh(qd / 5e-3))
        tau = law.command(q, qd, *path(begin + k * PERIOD)).tau + friction
        rows.append((stamp, q, qd, tau + EFFORT_NOISE * rng.normal(size=n)))
        while given and stamp > given[0].at + int(1e9 * PUSH):
            given.pop(0)
        plant.advance(tau + (torque_of(robot, q, given[0], stamp) if given else 0.0))
    columns = [np.array(column) for column in zip(*rows, strict=True)]
    return States(columns[0].astype(np.int64), *columns[1:])


# --- Judging


class Row(NamedTuple):
    """What one observer is worth with some detectors."""

    robot: str
    observer: str
    detectors: str
    duration: float  # [s] calibrated with
    rest: float  # [s] of it at rest
    held_out: str
    false: str  # alarms of the trial without a push
    spread: float  # rms of m r in it [N m]
    seen: dict  # by trial: of all, of which seen
    delays: dict  # by trial: median delay [s] of pushes that are seen
    median: float  # delay [s] of pushes that are seen, of all trials
    common: float  # the same of those that both observers see


SETS = {"two sets": True, "one set": False}


def judge(name, names, quiet, trials):
    """Rows of both observers: calibrated on `quiet`, judged on `trials`, each by observer; with one set and with two."""
    rows, delays = [], {}
    for label, knows_rest in SETS.items():
        for observer, free in quiet.items():
            residuals = Residuals(len(names))
            residuals.add_states(*_columns(*free[0], knows_rest))
            found = calibrate_residuals(
                residuals, names, FALSE_ALARMS, AlarmThresholds({}), gain=GAIN, friction=False
            )
            seen = {}
            for trial, given, by in trials:
                at = by[observer][0].stamps[_judged(names, found, *by[observer], knows_rest).begins]
                seen.setdefault(trial, []).extend(_delay(at, push) for push in given)
            states, observed = free[1]
            false = int(_judged(names, found, *free[1], knows_rest).begins.sum())
            late = delays[observer, label] = np.concatenate(list(seen.values()))
            rows.append(
                Row(
                    name, observer, label, found.duration, found.rest, f"{found.held_out}",
                    f"{false} in {1e-9 * (states.stamps[-1] - states.stamps[0]):.0f} s",
                    float(np.sqrt(np.nanmean(observed.external_torque**2))),
                    {trial: (len(lags), int(np.isfinite(lags).sum())) for trial, lags in seen.items()},
                    {trial: _median(np.array(lags)) for trial, lags in seen.items()}, _median(late), np.nan,
                )
            )  # fmt: skip
    return [row._replace(common=_common(delays, row)) for row in rows]


def _median(late):
    """Median of the finite delays [s]."""
    return float(np.median(late[np.isfinite(late)])) if np.isfinite(late).any() else np.nan


def _columns(states, observed, knows_rest):
    velocity = states.qd if knows_rest else None
    return states.stamps, observed.residual, observed.external_torque, observed.valid, velocity


def _common(delays, row):
    both = np.isfinite([delays[observer, row.detectors] for observer in OBSERVERS]).all(axis=0)
    return float(np.median(delays[row.observer, row.detectors][both])) if both.any() else np.nan


def _judged(names, thresholds, states, observed, knows_rest):
    *columns, velocity = _columns(states, observed, knows_rest)
    return AlarmDetector(names, thresholds).judge(*columns, velocity=velocity)


def _delay(begins, push):
    """From the onset of a push to the alarm [s]; inf if there is none in time."""
    passed = 1e-9 * (begins - push.at)
    inside = passed[(passed >= 0.0) & (passed <= LATEST)]
    return float(inside[0]) if len(inside) else np.inf


def recorded(robot, states, count, rng):
    """Rows of a recording."""
    middle = len(states.q) // 2
    first, second = states.part(slice(0, middle)), states.part(slice(middle, None))

    def by(some):
        known = robot.without_friction(some)
        return {name: (known, observe(robot, known)) for name, observe in OBSERVERS.items()}

    calm = [by(first), by(second)]
    trials = []
    for force in FORCES:
        each = max(1, int((1e-9 * (second.stamps[-1] - second.stamps[0]) - 3.0) / (1.5 * PAUSE)))
        for _ in range(-(-count // each)):
            given = pushes(rng, robot, second.stamps, each, force)
            trials.append((f"{force:g} N", given, by(pushed(robot, second, given))))
    quiet = {name: [one[name] for one in calm] for name in OBSERVERS}
    return judge(robot.name, robot.model.dof_names, quiet, trials)


def simulated(count, seconds, rng, stops):
    """Rows of the simulated Panda, on sines or with stops."""
    options = {"locked_joints": {"panda_finger_joint1": 0.0}, "mimic": "lock"}
    n = 7
    true = tuple((STICTION if stops else 1.0) * rng.uniform(low, 1.0, n) for low in (0.2, 0.3))
    robot = Robot(
        f"Panda, simulated{' with stops' * stops}, {KNOWN:.0%} of its friction known", find_urdf("panda"), LINKS,
        (KNOWN * true[0], KNOWN * true[1], np.zeros(n)), **options,
    )  # fmt: skip

    def by(some):
        known = robot.without_friction(some)
        return {name: (known, observe(robot, known)) for name, observe in OBSERVERS.items()}

    path = (Stops if stops else Sines)(robot.model, rng)
    calm = [by(simulate(robot, true, path, begin, seconds, rng)) for begin in (0.0, 600.0)]
    trials = []
    for number, force in enumerate(FORCES):
        for kind, (first, last) in (PUSHED if stops else {"": (0.0, 0.0)}).items():
            length, ats = 3.0 + 2.0 * PAUSE * count, None
            if stops:
                length = PERIOD_OF_STOPS * (count + 1)
                ats = np.round(
                    1e9 * (PERIOD_OF_STOPS * np.arange(count) + rng.uniform(first, last, count))
                )
                ats = ats.astype(np.int64)
            given = pushes(rng, robot, np.array([0, round(1e9 * length)]), count, force, ats)
            begin = PERIOD_OF_STOPS * (200 + 70 * number)
            states = simulate(robot, true, path, begin, length, rng, given)
            trials.append((f"{kind} {force:g} N".strip(), given, by(states)))
    quiet = {name: [one[name] for one in calm] for name in OBSERVERS}
    return judge(robot.name, robot.model.dof_names, quiet, trials)


HEAD = f"""# Benchmark of collision thresholds

`make bench ARGS="--only alarms"`. Both observers at {GAIN:g} 1/s, calibrated by `diag_dynamics.calibrate` to
{format_rate(FALSE_ALARMS)} for all their detectors together, and judged by the same detector. *Two sets*: standing and
moving arms are judged apart. Pushes of {PUSH:g} s, half a sine, at random links and in random directions; seen within
{LATEST:g} s. Each cell has the pushes that are seen, and their median delay.
*Held out*: alarms in parts of what calibrated, by thresholds from the other parts. *False*: alarms of motion without a
push that no threshold is from. *Common*: delays of pushes that both observers see by the same detectors. A push that
comes while a false alarm is on counts as not seen.

Recorded arms: friction and offset are identified on the half that calibrates. Pushes are put into the efforts of the
other half, which may show a false alarm as a push that is seen.
"""


def table(rows):
    """The results as text."""
    lines, shown = [HEAD], None
    for row in rows:
        if row.robot != shown:
            shown = row.robot
            heads = list(row.seen)
            lines += [
                f"## {row.robot}",
                "",
                f"Calibrated on {row.duration:.0f} s, of which {row.rest:.0f} s at rest.",
                "",
                "| detectors | settles on | held out | false | rms m r [N m] "
                f"| {' | '.join(heads)} | median delay | common |",
                "|---" * (7 + len(heads)) + "|",
            ]
        seen = [
            f"{part} of {whole}, {_in_ms(row.delays[trial])}"
            for trial, (whole, part) in row.seen.items()
        ]
        cells = [row.detectors, row.observer, row.held_out, row.false, f"{row.spread:.3g}", *seen]
        cells += [_in_ms(late) for late in (row.median, row.common)]
        lines.append(f"| {' | '.join(cells)} |")
        if row.detectors == "one set" and row.observer == "working moment":
            lines.append("")
    return "\n".join(lines)


def _in_ms(late):
    return "none" if np.isnan(late) else f"{1e3 * late:.0f} ms"


def compare(short):
    """Rows of all."""
    rows, count, rng = [], 10 if short else 50, np.random.default_rng(20)
    with tempfile.TemporaryDirectory() as folder:
        if RECORDINGS.exists():
            rows += recorded(*kuka(), count, rng)
            rows += recorded(*panda(Path(folder)), count, rng)
        else:
            print(f"{RECORDINGS} is not there: only what is simulated")
    for stops in (False, True):
        rows += simulated(*((10, 60.0) if short else (40, 300.0)), np.random.default_rng(20), stops)
    return rows


def write(rows, folder):
    """Write the table."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "alarms.md").write_text(table(rows), encoding="utf-8")
