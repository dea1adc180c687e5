# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Alarms with and without the dead zone of standing joints, beside a momentum observer by Pinocchio.

`make bench ARGS="--only alarms"` writes alarms.md into results.

Real recordings without contact (../shared/recordings) have pushes put into their efforts: on an arm that is held on its way,
a push is what the efforts are short of. One half of a recording calibrates, the other one is pushed. The simulated Panda is
pushed indeed, under a tracking law, and has other friction than the observer knows of. It stops after each motion, where
its friction holds it, and is pushed there or on its way. Three further arms are plants of Pinocchio with stiction, whose
programs move some of the joints and stop: see arms_with_stiction.py.

The momentum observer (De Luca and Mattone, 2003) has the thresholds of the row without a dead zone.
"""

import os
import tempfile
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import NamedTuple

import arms_with_stiction
import numpy as np
import pinocchio as pin

import diag_dynamics as dd
from diag_dynamics.collision.calibration import calibrate_residuals, format_rate
from diag_dynamics.collision.residuals import Residuals
from diag_dynamics.control.dead_zone import DeadZone
from diag_dynamics.description.catalog import find_urdf
from diag_dynamics.recordings.external_torque import Observer
from diag_dynamics.recordings.states import States as RecordedStates

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
ARMS = "ur5_robot", "xarm7", "z1"
MOTION, PERIOD_OF_STOPS, PERIOD_OF_PUSHES = 3.0, 6.0, 5.0  # [s]
PUSHED = {
    "standing": (4.0, 5.4),
    "moving": (0.5, 2.2),
}  # when a push begins, after the beginning of a motion [s]
PERIOD = 2e-3  # [s] of the simulated samples
STICTION = 8.0  # factor on the simulated friction
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
    """A robot as the observer knows it."""

    def __init__(self, name, urdf, links, parameters=None, **options):
        self.name, self.links, self.urdf, self.options = name, links, str(urdf), options
        self.know(parameters or {})

    def know(self, parameters):
        """Use parameters by joint."""
        self.model = dd.load_urdf(self.urdf, **self.options)
        if parameters:
            self.model = self.model.with_parameters({"joints": parameters})
        self.dyn = dd.DiagonalDynamics(self.model)

    def observed(self, states):
        """Return what the observer estimates."""
        none = np.zeros(len(states.stamps), dtype=bool)
        stamps = (states.stamps,) * 3
        motion = map(np.ascontiguousarray, states[1:])
        rows = RecordedStates(*stamps, *motion, ~none, none, none, none)
        observer = Observer(self.dyn, GAIN, friction=True)
        batches = [columns for _, columns in observer.observe_states(rows)]
        r, torque, _, valid = (np.concatenate(column) for column in zip(*batches, strict=True))
        return Observed(states, r, torque, valid)

    def begins_by_momentum(self, states, thresholds):
        """Return stamps at which a momentum observer by Pinocchio is above the thresholds, a second apart."""
        own, model = self.model, pin.buildModelFromUrdf(self.urdf)
        # Joints in `locked_joints` and their mimic joints, all at 0.
        locked = [joint for joint, name in enumerate(model.names) if name not in own.dof_names][1:]
        if locked:  # Pinocchio reduces no model of a link and a joint of one name (Z1)
            model = pin.buildReducedModel(model, locked, pin.neutral(model))
        assert tuple(model.names[1:]) == own.dof_names
        data = model.createData()
        limits = thresholds.of_names(own.dof_names)
        r, integral, begins, last = np.zeros(own.nv), None, [], -np.inf
        for k, (stamp, q, qd, tau) in enumerate(zip(*states, strict=True)):
            M = pin.crba(model, data, q)
            M = np.triu(M) + np.triu(M, 1).T + np.diag(own.armature)
            C = pin.computeCoriolisMatrix(model, data, q, qd)
            g = pin.computeGeneralizedGravity(model, data, q)
            g_size = own.friction + own.load_friction * np.abs(g)
            friction = own.damping * qd + g_size * np.tanh(qd / 5e-3) + own.effort_offset
            rate = tau - friction + C.T @ qd - g
            p = M @ qd
            if integral is None:
                integral, before = p.copy(), rate
                continue
            dt = 1e-9 * (stamp - states.stamps[k - 1])
            integral += dt * (0.5 * (before + rate) + r)
            before, r = rate, GAIN * (p - integral)
            norm = np.sqrt(r @ np.linalg.solve(M, r))
            if (np.array([*np.abs(r), np.linalg.norm(r), norm]) > limits).any():
                if stamp - last > 1e9:
                    begins.append(stamp)
                last = stamp
        return np.array(begins)


class Observed(NamedTuple):
    """States, and r, m r and whether there is a result at each of them."""

    states: States
    residual: np.ndarray
    torque: np.ndarray
    valid: np.ndarray

    def lowered(self, robot, fraction):
        """Return stamps, r and m r by a dead zone, and whether there is a result."""
        stamps, q, qd, _ = self.states
        zone = DeadZone(robot.dyn, fraction, GAIN)
        r, torque = zone.lower(stamps, q, qd, self.residual, self.torque)
        return stamps, r, torque, self.valid


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
    names = "damping", "friction", "effort_offset"
    robot.know(
        {
            joint: dict(zip(names, (max(0.0, d), max(0.0, f), offset), strict=True))
            for joint, (d, f, offset) in zip(robot.model.dof_names, fitted, strict=True)
        }
    )
    return robot, states


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
    """Pushes that are detected with a dead zone, or by the momentum observer."""

    robot: str
    detector: str
    duration: float  # [s] calibrated with
    held_out: str
    false: str  # alarms of the trial without a push
    seen: dict  # by trial: of all, of which seen
    delays: dict  # by trial: median delay [s] of pushes that are seen
    median: float  # delay [s] of pushes that are seen, of all trials


FRACTIONS = 0.0, 1.25
"""Dead zones by the Coulomb friction."""


def judge(robot, quiet, trials):
    """Return rows: calibrated on the first of `quiet`, false alarms of the second, pushes of the trials."""
    rows, names = [], robot.model.dof_names
    for fraction in FRACTIONS:
        residuals = Residuals(len(names))
        residuals.add_states(*quiet[0].lowered(robot, fraction))
        template = dd.Thresholds(stiction=fraction)
        thresholds = calibrate_residuals(
            residuals, names, FALSE_ALARMS, template, gain=GAIN, friction=True
        )

        def begins(observed, thresholds=thresholds, fraction=fraction):
            judged = dd.Detector(names, thresholds).judge(*observed.lowered(robot, fraction))
            return observed.states.stamps[judged.begins]

        rows.append(_row(robot, f"dead zone {fraction:g}", thresholds, begins, quiet[1], trials))
        if fraction == 0.0:

            def by_momentum(observed, thresholds=thresholds):
                return robot.begins_by_momentum(observed.states, thresholds)

            rows.append(_row(robot, "momentum", thresholds, by_momentum, quiet[1], trials))
    return rows


def _row(robot, label, thresholds, begins, quiet, trials):
    """Return the row of a detector, whose alarms begin at the stamps `begins(observed)`."""
    seen = {}
    for trial, given, observed in trials:
        at = begins(observed)
        seen.setdefault(trial, []).extend(_delay(at, push) for push in given)
    stamps = quiet.states.stamps
    false = f"{len(begins(quiet))} in {1e-9 * (stamps[-1] - stamps[0]):.0f} s"
    counts = {trial: (len(lags), int(np.isfinite(lags).sum())) for trial, lags in seen.items()}
    delays = {trial: _median(np.array(lags)) for trial, lags in seen.items()}
    late = _median(np.concatenate(list(seen.values())))
    held_out = f"{thresholds.held_out}"
    return Row(robot.name, label, thresholds.duration, held_out, false, counts, delays, late)


def _median(late):
    """Median of the finite delays [s]."""
    return float(np.median(late[np.isfinite(late)])) if np.isfinite(late).any() else np.nan


def _delay(begins, push):
    """From the onset of a push to the alarm [s]; inf if there is none in time."""
    passed = 1e-9 * (begins - push.at)
    inside = passed[(passed >= 0.0) & (passed <= LATEST)]
    return float(inside[0]) if len(inside) else np.inf


def recorded(robot, states, count, rng):
    """Rows of a recording."""
    middle = len(states.q) // 2
    first, second = states.part(slice(0, middle)), states.part(slice(middle, None))
    trials = []
    for force in FORCES:
        each = max(1, int((1e-9 * (second.stamps[-1] - second.stamps[0]) - 3.0) / (1.5 * PAUSE)))
        for _ in range(-(-count // each)):
            given = pushes(rng, robot, second.stamps, each, force)
            trials.append((f"{force:g} N", given, robot.observed(pushed(robot, second, given))))
    return judge(robot, [robot.observed(states) for states in (first, second)], trials)


def simulated(count, seconds, rng):
    """Rows of the simulated Panda, which stops after each motion."""
    options = {"locked_joints": {"panda_finger_joint1": 0.0}, "mimic": "lock"}
    n = 7
    true = tuple(STICTION * rng.uniform(low, 1.0, n) for low in (0.2, 0.3))
    known = [
        {"damping": KNOWN * damping, "friction": KNOWN * friction}
        for damping, friction in zip(*true, strict=True)
    ]
    joints = [f"panda_joint{k}" for k in range(1, n + 1)]
    robot = Robot(
        f"Panda, simulated with stops, {KNOWN:.0%} of its friction known",
        find_urdf("panda"),
        LINKS,
        dict(zip(joints, known, strict=True)),
        **options,
    )
    path = Stops(robot.model, rng)
    quiet = [
        robot.observed(simulate(robot, true, path, begin, seconds, rng)) for begin in (0.0, 600.0)
    ]
    trials = []
    for number, force in enumerate(FORCES):
        for kind, (first, last) in PUSHED.items():
            length = PERIOD_OF_STOPS * (count + 1)
            begins = PERIOD_OF_STOPS * np.arange(count) + rng.uniform(first, last, count)
            ats = np.round(1e9 * begins).astype(np.int64)
            given = pushes(rng, robot, np.array([0, round(1e9 * length)]), count, force, ats)
            begin = PERIOD_OF_STOPS * (200 + 70 * number)
            states = simulate(robot, true, path, begin, length, rng, given)
            trials.append((f"{kind} {force:g} N", given, robot.observed(states)))
    return judge(robot, quiet, trials)


def with_stiction(arm, seconds, count):
    """Rows of an arm of Pinocchio with stiction."""
    urdf = find_urdf(arm)
    plant = arms_with_stiction.Arm(str(urdf))
    robot = Robot(f"{arm}, plant of Pinocchio with stiction", urdf, (), plant.identified())
    quiet = []
    for seed in (1, 2):
        states, _ = plant.record(seconds, seed)
        quiet.append(robot.observed(States(*states)))
    trials = []
    for force in FORCES[1:]:
        states, ats = plant.record(PERIOD_OF_PUSHES * count, 3 + int(force), count, force)
        given = [Push(at, "", force) for at in ats]
        trials.append((f"{force:g} N", given, robot.observed(States(*states))))
    return judge(robot, quiet, trials)


HEAD = f"""# Benchmark of collision thresholds

`make bench ARGS="--only alarms"`. The observer at {GAIN:g} 1/s, calibrated by `diag_dynamics.calibrate` to
{format_rate(FALSE_ALARMS)} for all its detectors together. *Dead zone* of |m r| of standing joints: fraction of the Coulomb
friction. *Momentum*: an observer by Pinocchio with the thresholds of the row without a dead zone.
Pushes of {PUSH:g} s, half a sine, at random links and in random directions; seen within {LATEST:g} s. Each cell has the
pushes that are seen, and their median delay.
*Held out*: alarms in parts of what calibrated, by thresholds from the other parts. *False*: alarms of motion without a
push that no threshold is from.

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
                f"\n## {row.robot}",
                "",
                f"Calibrated on {row.duration:.0f} s.",
                "",
                f"| detector | held out | false | {' | '.join(heads)} | median delay |",
                "|---" * (4 + len(heads)) + "|",
            ]
        seen = [
            f"{part} of {whole}, {_in_ms(row.delays[trial])}"
            for trial, (whole, part) in row.seen.items()
        ]
        cells = [row.detector, row.held_out, row.false, *seen, _in_ms(row.median)]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join([*lines, ""])


def _in_ms(late):
    return "none" if np.isnan(late) else f"{1e3 * late:.0f} ms"


def compare(short):
    """Rows of all."""
    rows, count, rng = [], 2 if short else 50, np.random.default_rng(20)
    with tempfile.TemporaryDirectory() as folder:
        if RECORDINGS.exists():
            rows += recorded(*kuka(), count, rng)
            rows += recorded(*panda(Path(folder)), count, rng)
        else:
            print(f"{RECORDINGS} is not there: only what is simulated")
    rows += simulated(*((1, 15.0) if short else (40, 300.0)), np.random.default_rng(20))
    for arm in ARMS[-1:] if short else ARMS:
        rows += with_stiction(arm, *((15.0, 1) if short else (300.0, 10)))
    return rows


def write(rows, folder):
    """Write the table."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "alarms.md").write_text(table(rows), encoding="utf-8")
