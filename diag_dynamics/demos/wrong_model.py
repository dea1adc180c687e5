# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""From a model that is wrong to alarms that work: identify, calibrate, and see pushes, on simulated robots."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from diag_dynamics.collision.detector import AlarmDetector
from diag_dynamics.demos.simulated_robot import ERRORS, Push, real_robot, recorded
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.identification.excite import excite
from diag_dynamics.identification.identify import identify
from diag_dynamics.model import RobotModel, load_robot
from diag_dynamics.recordings.calibration import calibrate
from diag_dynamics.recordings.observer import observe
from diag_dynamics.recordings.recording import read_recording

ROBOTS: Mapping[str, Mapping[str, float]] = {
    "panda": dict.fromkeys(("panda_finger_joint1", "panda_finger_joint2"), 0.0),
    "ur5_robot": {},
    "tiago_no_hand": dict.fromkeys(
        ("head_1_joint", "head_2_joint", "wheel_left_joint", "wheel_right_joint", "torso_lift_joint"), 0.0
    ),
}
"""Robots, each with the joints that are held: fingers; of a mobile base with an arm its wheels, torso and head."""

PUSHES = 10

FORCE = 30.0
"""Of each [N]."""

GAIN = 25.0
"""Of the observer [1/s]."""

FALSE_ALARMS = 1.0 / 60.0
"""That are accepted [1/s]."""


class Judgement(NamedTuple):
    """What a model made of a recording with pushes.

    Attributes
    ----------
    time : ndarray, shape (T,)
        [s].
    score : ndarray, shape (T,)
        The largest ratio of a detector to its threshold: above 1 there is an alarm.
    delays : list of float or None
        From the begin of each push to the alarm, None if there was none [s].
    false_alarms : int
        Alarms while nothing pushed.
    energy : ndarray, shape (T,)
        Kinetic energy by the model [J].
    """

    time: np.ndarray
    score: np.ndarray
    delays: list
    false_alarms: int
    energy: np.ndarray

    @property
    def seen(self):
        """How many pushes were seen."""
        return sum(delay is not None for delay in self.delays)


class Story(NamedTuple):
    """One robot: what was identified, and what its wrong and its identified model made of pushes."""

    name: str
    model: RobotModel
    found: object
    pushes: list
    before: Judgement
    after: Judgement
    energy: np.ndarray


def story_of(name, folder, off=0.3, seed=1, minutes=3):
    """Go through all of it with one robot.

    Parameters
    ----------
    name : str
        One of :data:`ROBOTS`.
    folder : Path
        Where the recordings and files of parameters go.
    off : float
        By which part the robot's inertias are off from its URDF's.
    seed : int
        Of chance.
    minutes : int
        Of motion without contact that thresholds are calibrated with.

    Returns
    -------
    Story
    """
    folder = Path(folder)
    model = load_robot(name, locked_joints=ROBOTS[name])
    robot = real_robot(model, off, seed)

    def record(what, motion, pushes=()):
        path = folder / f"{name}_{what}.npz"
        errors = ERRORS._replace(seed=len(list(folder.glob("*.npz"))))  # no two recordings have the same noise
        np.savez(path, **recorded(robot, model, *motion[1:5], pushes=pushes, errors=errors)._asdict())
        return read_recording(path, model)

    motion = excite(model, "friction", trials=100, velocity=0.6, seed=seed)
    found = identify(record("to_identify", motion), model, ("friction", "rotors", "inertias"))
    found.save(folder / f"{name}_arm.yaml")
    work = [excite(model, "friction", trials=3, velocity=0.6, duration=60.0, seed=seed + 1 + k) for k in range(minutes)]
    free = [record(f"free_{k}", one) for k, one in enumerate(work)]
    pushes = _pushes(robot, work[0], np.random.default_rng(seed))
    pushed = record("pushed", work[0], pushes)  # alarms are for the motions that they were calibrated with
    judged = []
    for one, what in ((model, "urdf"), (found.model, "identified")):
        dynamics = DiagonalDynamics(one)
        thresholds = calibrate(free, dynamics, gain=GAIN, false_alarms=FALSE_ALARMS)
        thresholds.save(folder / f"{name}_alarms_{what}.yaml")
        judged.append(_judged(dynamics, thresholds, pushed, pushes))
    real = DiagonalDynamics(robot).evaluate_batch(pushed.q, pushed.qd).kinetic_energy
    return Story(name, model, found, pushes, *judged, real)


def _pushes(robot, motion, rng):
    """Pushes on links beyond the middle of the arm, for a third of a second each, in any direction."""
    ends = motion.time[-1] * (np.arange(PUSHES) + rng.uniform(0.3, 0.7, PUSHES)) / PUSHES
    outer = range(len(robot.bodies) // 2, len(robot.bodies))
    links = [name for name in robot.link_names if robot.placement_in_body(name)[0] in outer]
    pushes = []
    for at in ends:
        direction = rng.normal(size=3)
        link = links[rng.integers(len(links))]
        pushes.append(Push(link, at, at + 1 / 3, FORCE * direction / np.linalg.norm(direction)))
    return pushes


def _judged(dynamics, thresholds, recording, pushes):
    """What a model's observer and thresholds make of a recording."""
    seen = observe(dynamics, recording, GAIN)
    detector = AlarmDetector(dynamics.model.dof_names, thresholds)
    judged = detector.judge(recording.stamp, seen.residual, seen.external_torque, seen.valid)
    begins = recording.t[judged.begins]
    delays = []
    for push in pushes:
        within = begins[(begins >= push.begin) & (begins < push.end + 0.1)]
        delays.append(float(within[0] - push.begin) if len(within) else None)
    false = sum(not any(push.begin <= at < push.end + 1.0 for push in pushes) for at in begins)
    score = (judged.values / detector.limits).max(axis=1)
    energy = dynamics.evaluate_batch(recording.q, recording.qd).kinetic_energy
    return Judgement(recording.t, score, delays, false, energy)


def text_of(story):
    """What came of it, in lines."""
    quality = story.found.quality
    lines = [f"{story.name}: identified {', '.join(quality['taken'])} from 20 s of motion"]
    shares = ["-" if share is None else f"{share:.2f}" for share in quality["explained"]]
    lines.append(f"  the balance of power explains {shares[0]} of dK/dt with the URDF, {shares[1]} identified")
    off = [
        np.sqrt(np.mean((one.energy / story.energy.mean() - story.energy / story.energy.mean()) ** 2))
        for one in story[4:6]
    ]
    lines.append(
        f"  kinetic energy is off by {100 * off[0]:.0f} % of its mean with the URDF, {100 * off[1]:.0f} % identified"
    )
    for one, what in ((story.before, "with the URDF"), (story.after, "identified")):
        delays = [1e3 * delay for delay in one.delays if delay is not None]
        late = f", after {np.median(delays):.0f} ms" if delays else ""
        lines.append(
            f"  {what}: {one.seen} of {len(one.delays)} pushes seen{late}; {one.false_alarms} false alarms in a minute"
        )
    return lines


def picture(stories, path):
    """Draw before and after of each robot into an image file (format by its suffix)."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg  # slow to import, and seldom needed
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12, 1.0 + 2.6 * len(stories)), layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.subplots(len(stories), 2, squeeze=False, width_ratios=[1.7, 1.0])
    for row, story in zip(grid, stories, strict=True):
        _alarms(row[0], story)
        _energies(row[1], story)
    for axes, columns in zip(grid[0], (4, 3), strict=True):
        axes.legend(loc="lower right", fontsize=8, frameon=False, ncols=columns, bbox_to_anchor=(1.0, 1.0))
    for axes in grid[-1]:
        axes.set_xlabel("time [s]", fontsize=9)
    figure.savefig(path, dpi=120)


BEFORE, AFTER, REAL, PUSHED = "#a9adb5", "#0b6fb8", "#d1495b", "#f6dfc0"


def _alarms(axes, story):
    for k, push in enumerate(story.pushes):
        axes.axvspan(push.begin, push.end, color=PUSHED, linewidth=0, label="push" if k == 0 else None)
    for one, color, what in ((story.before, BEFORE, "URDF"), (story.after, AFTER, "identified")):
        axes.plot(one.time, np.maximum(one.score, 1e-3), color=color, linewidth=0.9, label=what)
    axes.axhline(1.0, color=REAL, linewidth=1.0, linestyle="--", label="threshold")
    axes.set_yscale("log")
    axes.set_ylim(0.03, 30.0)
    axes.margins(x=0)
    axes.set_ylabel("torque / threshold", fontsize=9)
    axes.set_title(
        f"{story.name}: {story.before.seen}, then {story.after.seen} of {len(story.pushes)} pushes seen",
        loc="left",
        fontsize=10,
    )
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(labelsize=8)


def _energies(axes, story):
    time = story.before.time
    part = time < 10.0
    for energy, color, what in (
        (story.before.energy, BEFORE, "URDF"),
        (story.energy, REAL, "truth"),
        (story.after.energy, AFTER, "identified"),
    ):
        axes.plot(
            time[part], energy[part], color=color, linewidth=1.2, label=what, linestyle="--" if what == "truth" else "-"
        )
    axes.set_ylabel("kinetic energy [J]", fontsize=9)
    axes.set_ylim(bottom=0.0)
    axes.margins(x=0)
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(labelsize=8)
