# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""From a wrong model to alarms: identify and calibrate simulated robots whose inertias differ from their URDFs."""

import argparse
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure

import diag_dynamics as dd
from diag_dynamics.control.dead_zone import DeadZone
from diag_dynamics.simulation.drives import Sensors

ROBOTS = {
    "panda": ("panda_finger_joint1", "panda_finger_joint2"),
    "ur5_robot": (),
    "tiago_no_hand": (
        "head_1_joint",
        "head_2_joint",
        "wheel_left_joint",
        "wheel_right_joint",
        "torso_lift_joint",
    ),
}
"""Robots, each with its locked joints."""

STEP, STEPS_PER_STATE, BANDWIDTH = 1e-3, 4, 8.0
"""Step of the simulation [s], steps from one recorded state to the next, and bandwidth of the position loop [1/s]."""

NOISE = 2e-5, 1e-3, 0.1
"""Of a good drive: noise of encoder and filtered velocity, ripple of torque [rad, rad/s, N m]."""

PUSHES, FORCE, DURATION = 10, 30.0, 1.0 / 3.0
"""Number of pushes, force [N] and duration [s] of each."""

GAIN, FALSE_ALARMS, MINUTES = 25.0, 1.0 / 60.0, 3
"""Gain of the observer [1/s], accepted false alarms [1/s], minutes of motion that calibrate the thresholds."""

BEFORE, AFTER, REAL, PUSHED = "#a9adb5", "#0b6fb8", "#d1495b", "#f6dfc0"


class Push(NamedTuple):
    """A force on a link [N] along the axes of the world."""

    link: str
    begin: float
    end: float
    force: np.ndarray


def real_links(model, error, rng):
    """Return bodies of links whose masses, centres in radii of gyration and lengths differ.

    The error of lengths is half of that of masses.
    """
    links = {}
    for name, link in model.description.links.items():
        if link.inertial is None or not link.inertial.mass:
            continue
        body = link.inertial.body
        heavier, longer = 1.0 + error * rng.uniform(-1.0, 1.0, 2) * (1.0, 0.5)
        radius = np.sqrt(0.5 * np.trace(body.inertia) / body.mass)
        centre = body.centre + error * radius * rng.uniform(-1.0, 1.0, 3) / np.sqrt(3.0)
        inertia = heavier * longer**2 * body.inertia
        links[name] = dd.Payload(heavier * body.mass, centre, inertia)
    return links


def real_robot(model, error, seed):
    """Return a robot with other inertias than its model, and with friction and rotors of geared joints."""
    rng = np.random.default_rng(seed)
    effort = np.where(
        np.isfinite(model.effort_limit) & (model.effort_limit > 0.0), model.effort_limit, 50.0
    )
    speed = np.where(
        np.isfinite(model.velocity_limit) & (model.velocity_limit > 0.0), model.velocity_limit, 2.0
    )
    damping, friction, offset, armature = rng.uniform(0.7, 1.3, (4, model.nv))
    values = {
        "damping": 0.04 * effort / speed * damping,
        "friction": 0.04 * effort * friction,
        "effort_offset": 0.01 * effort * (offset - 1.0) / 0.3,
        "armature": 0.05 * effort / speed * armature,
    }
    joints = {}
    for k, name in enumerate(model.dof_names):
        joints[name] = dd.JointParameters(**{key: float(value[k]) for key, value in values.items()})
    links = real_links(model, error, rng)
    return model.with_parameters(dd.Parameters(joints=joints, links=links))


def record(robot, known, sensors, time, position, velocity, acceleration, pushes=()):
    """Return times, positions, velocities and efforts that sensors measure while a robot follows a motion.

    The controller computes efforts by the model `known`; a spring bounds the error that unknown friction causes.
    """
    simulation, dynamics = (
        dd.Simulation(robot, q=position[0], step=STEP),
        dd.DiagonalDynamics(known),
    )
    stiffness, states = 40.0 * np.maximum(robot.friction, 0.1), []
    stamps = STEP * np.arange(round((time[-1] - time[0]) / STEP))
    motion = np.hstack([position, velocity, acceleration])
    motion = np.column_stack([np.interp(stamps, time, column) for column in motion.T])
    for k, (position, velocity, acceleration) in enumerate(motion.reshape(len(motion), 3, -1)):
        q, qd, limits = simulation.q, simulation.qd, simulation.effort_limits
        error, rate = position - q, velocity - qd
        acceleration = acceleration + 2.0 * BANDWIDTH * rate + BANDWIDTH**2 * error
        effort = dynamics.inverse_dynamics(q, qd, acceleration) + stiffness * (error + 0.2 * rate)
        if k % STEPS_PER_STATE == 0:
            states.append(sensors.measure(q, qd, np.clip(effort, -limits, limits)))
        active = [push for push in pushes if push.begin <= stamps[k] < push.end]
        wrenches = {push.link: np.r_[push.force, np.zeros(3)] for push in active}
        simulation.advance(effort, f_ext=wrenches or None, frame="world" if wrenches else "link")
    q, qd, tau = (np.array(values) for values in zip(*states, strict=True))
    return {"t": stamps[::STEPS_PER_STATE], "q": q, "qd": qd, "tau": tau}


def random_pushes(robot, motion, rng):
    """Return pushes in random directions on links beyond the middle of the arm."""
    begins = motion.time[-1] * (np.arange(PUSHES) + rng.uniform(0.3, 0.7, PUSHES)) / PUSHES
    middle, pushes = len(robot.bodies) // 2, []
    links = [
        name
        for name in robot.link_names
        if middle <= robot.placement_in_body(name)[0] < len(robot.bodies)
    ]
    for begin in begins:
        direction = rng.normal(size=3)
        link = links[rng.integers(len(links))]
        pushes.append(
            Push(link, begin, begin + DURATION, FORCE * direction / np.linalg.norm(direction))
        )
    return pushes


def judge(dynamics, thresholds, recording, pushes):
    """Return what a model makes of pushes: ratio to the threshold, delays, number of false alarms, kinetic energy."""
    observed = dd.observe(dynamics, recording, GAIN)
    detector = dd.Detector(dynamics.model.dof_names, thresholds)
    zone = DeadZone(dynamics, thresholds.stiction, GAIN)
    motion = recording.q, recording.qd
    columns = observed.residual, observed.external_torque
    lowered = zone.lower(recording.stamp, *motion, *columns)
    alarms = detector.judge(recording.stamp, *lowered, observed.valid)
    begins = recording.t[alarms.begins]
    first = [
        begins[(begins >= push.begin) & (begins < push.end + 0.1)][:1] - push.begin
        for push in pushes
    ]
    false = sum(
        not any(push.begin <= begin < push.end + 1.0 for push in pushes) for begin in begins
    )
    energy = dynamics.evaluate(recording.q, recording.qd).kinetic_energy
    return (alarms.values / detector.limits).max(axis=1), np.concatenate(first), false, energy


def demonstrate(name, folder, error, seed):
    """Identify and calibrate one robot; print the result and return (name, times, pushes, judgements, real energy)."""
    model = dd.load_robot(name, locked_joints=dict.fromkeys(ROBOTS[name], 0.0))
    robot, sensors = real_robot(model, error, seed), Sensors(NOISE)

    def recorded(what, motion, pushes=()):
        path = folder / f"{name}_{what}.npz"
        np.savez(path, **record(robot, model, sensors, *motion[1:5], pushes=pushes))
        return dd.read_recording(path, model)

    motion = dd.excite(model, "friction", trials=100, velocity=0.6, seed=seed)
    found = dd.identify(recorded("to_identify", motion), model, ("friction", "rotors", "inertias"))
    found.save(folder / f"{name}_arm.yaml")
    seeds = range(seed + 1, seed + 1 + MINUTES)
    work = [
        dd.excite(model, "friction", trials=3, velocity=0.6, duration=60.0, seed=one)
        for one in seeds
    ]
    free = [recorded(f"free_{k}", motion) for k, motion in enumerate(work)]
    pushes = random_pushes(robot, work[0], np.random.default_rng(seed))
    pushed, judged = recorded("pushed", work[0], pushes), []
    for what, one in (("urdf", model), ("identified", found.model)):
        dynamics = dd.DiagonalDynamics(one)
        thresholds = dd.calibrate(free, dynamics, gain=GAIN, false_alarms=FALSE_ALARMS)
        thresholds.save(folder / f"{name}_alarms_{what}.yaml")
        judged.append(judge(dynamics, thresholds, pushed, pushes))
    energy = dd.DiagonalDynamics(robot).evaluate(pushed.q, pushed.qd).kinetic_energy
    print(f"{name}: identified {', '.join(found.quality['taken'])} from 20 s of motion")
    shares = ["-" if share is None else f"{share:.2f}" for share in found.quality["explained"]]
    print(f"  variance of dK/dt explained: {shares[0]} with the URDF, {shares[1]} identified")
    for what, (_, delays, false, estimate) in zip(
        ("with the URDF", "identified"), judged, strict=True
    ):
        off = 100.0 * np.sqrt(np.mean((estimate - energy) ** 2)) / energy.mean()
        late = f" after {1e3 * np.median(delays):.0f} ms" if len(delays) else ""
        print(
            f"  {what}: {len(delays)} of {PUSHES} pushes detected{late}; {false} false alarms in a minute; ",
            end="",
        )
        print(f"error of the kinetic energy {off:.0f} % of its mean", flush=True)
    return name, pushed.t, pushes, judged, energy


def draw(results, path):
    """Draw ratio to the threshold and kinetic energy of each robot."""
    figure = Figure(figsize=(12, 1.0 + 2.6 * len(results)), layout="constrained")
    grid = figure.subplots(len(results), 2, squeeze=False, width_ratios=[1.7, 1.0])
    for (alarms, energies), (name, t, pushes, judged, energy) in zip(grid, results, strict=True):
        for push in pushes:
            alarms.axvspan(
                push.begin,
                push.end,
                color=PUSHED,
                lw=0,
                label="push" if push is pushes[0] else None,
            )
        part = t < 10.0
        for (ratio, _, _, estimate), color, label in zip(
            judged, (BEFORE, AFTER), ("URDF", "identified"), strict=True
        ):
            alarms.plot(t, np.maximum(ratio, 1e-3), color=color, lw=0.9, label=label)
            energies.plot(t[part], estimate[part], color=color, lw=1.2, label=label)
        energies.plot(t[part], energy[part], color=REAL, lw=1.2, ls="--", label="truth")
        alarms.axhline(1.0, color=REAL, lw=1.0, ls="--", label="threshold")
        before, after = (len(one[1]) for one in judged)
        title = f"{name}: {before}, then {after} of {PUSHES} pushes detected"
        alarms.set(yscale="log", ylim=(0.03, 30.0), ylabel="torque / threshold", title=title)
        energies.set(ylabel="kinetic energy [J]", ylim=(0.0, None))
        for axes in (alarms, energies):
            axes.margins(x=0.0)
            axes.spines[["top", "right"]].set_visible(False)
    for top, bottom, columns in zip(grid[0], grid[-1], (4, 3), strict=True):
        top.legend(
            loc="lower right", bbox_to_anchor=(1.0, 1.08), fontsize=8, frameon=False, ncols=columns
        )
        bottom.set_xlabel("time [s]")
    figure.savefig(path, dpi=120)


def main(arguments=None):
    """Run the demo; the status is 1 where the identified model detects fewer than nine of ten pushes."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--robots",
        nargs="+",
        choices=ROBOTS,
        default=["panda"],
        help="default: panda; others need example-robot-data",
    )
    parser.add_argument(
        "--error", type=float, default=0.3, help="relative error of inertias (default: 0.3)"
    )
    parser.add_argument("--seed", type=int, default=1, help="of random numbers (default: 1)")
    parser.add_argument("--picture", metavar="PICTURE.png", help="file for the picture")
    parser.add_argument(
        "--keep", metavar="FOLDER", help="folder for recordings, arm.yaml and alarms.yaml"
    )
    chosen = parser.parse_args(arguments)
    results = []
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(chosen.keep or temporary)
        folder.mkdir(parents=True, exist_ok=True)
        for name in chosen.robots:
            print(
                f"{name}: simulation, identification and calibration take twenty seconds …",
                file=sys.stderr,
            )
            results.append(demonstrate(name, folder, chosen.error, chosen.seed))
    if chosen.picture:
        draw(results, chosen.picture)
    return 0 if all(len(judged[1][1]) >= 0.9 * PUSHES for _, _, _, judged, _ in results) else 1


if __name__ == "__main__":
    sys.exit(main())
