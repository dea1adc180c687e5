# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""`diag-dynamics excite`: a trajectory that moves a robot so that a recording of it tells what is to be identified."""

import argparse
import sys
from pathlib import Path

import numpy as np

from diag_dynamics.cli import given
from diag_dynamics.cli.robot_argument import ROBOT, parsed
from diag_dynamics.exceptions import InputError
from diag_dynamics.identification.excite import excite
from diag_dynamics.text import plain

MISSING = "of a joint for which the robot's file has none [{}]; * for all that lack one"
EPILOG = """Nobody looks whether the robot hits itself or something else. Try the trajectory on the simulator first, give
--range where there is less room than the joints have, and begin slowly (--velocity)."""


@given.reported
def run(name, arguments):
    """Write a trajectory; returns the exit status."""
    parser = argparse.ArgumentParser(prog=f"diag-dynamics {name}", description=__doc__, epilog=EPILOG)
    parser.add_argument("urdf", metavar="ROBOT", help=ROBOT)
    parser.add_argument(
        "--what", default="friction,rotors", help="as of diag-dynamics identify (default: friction,rotors)"
    )
    parser.add_argument("--duration", type=float, default=20.0, help="[s], a whole number of periods (default: 20)")
    parser.add_argument("--period", type=float, default=10.0, help="of the Fourier series [s] (default: 10)")
    parser.add_argument("--joints", help="those that move, separated by commas (default: all)")
    given.add_entries(parser, "--range", "JOINT=LOWER:UPPER", "of a joint's position [rad, m]")
    given.add_entries(parser, "--velocity-limit", "JOINT=LIMIT", MISSING.format("rad/s, m/s"))
    given.add_entries(parser, "--position-limit", "JOINT=LOWER:UPPER", MISSING.format("rad, m"))
    parser.add_argument("--velocity", type=float, default=0.5, help="part of the limits that is used (default: 0.5)")
    parser.add_argument("--effort", type=float, default=0.7, help="part of the limits that is used (default: 0.7)")
    parser.add_argument("--rate", type=float, default=50.0, help="of points [1/s] (default: 50)")
    parser.add_argument("--trials", type=int, default=300, help="trajectories that are looked at (default: 300)")
    parser.add_argument("--seed", type=int, default=0, help="of chance (default: 0)")
    parser.add_argument("--approach", type=float, default=5.0, help="time to get to the first point [s] (default: 5)")
    given.add_parameters(parser)
    parser.add_argument(
        "-o", "--output", metavar="OUT.json", help="times, positions, velocities, accelerations, efforts"
    )
    parser.add_argument(
        "--trajectory", metavar="OUT.yaml", help="trajectory_msgs/JointTrajectory, for the controller's mode tracking"
    )
    chosen = parsed(parser, arguments)
    if not (chosen.output or chosen.trajectory):
        parser.error("-o OUT.json or --trajectory OUT.yaml is expected: else nothing is kept")
    return _excite(chosen)


def _excite(chosen):
    model = given.chosen_model(chosen)
    names = "duration", "period", "velocity", "effort", "rate", "trials", "seed"
    with given.Progress() as line:
        found = excite(
            model,
            chosen.what.split(","),
            joints=None if chosen.joints is None else chosen.joints.split(","),
            ranges=dict(_range("--range", one) for one in chosen.range),
            velocity_limits=dict(map(_limit, chosen.velocity_limit)),
            position_limits=dict(_range("--position-limit", one) for one in chosen.position_limit),
            progress=lambda trial, condition: _show(line, trial, chosen.trials, condition),
            **{name: getattr(chosen, name) for name in names},
        )
    if chosen.output:
        Path(chosen.output).write_text(found.to_json(), encoding="utf-8")
    if chosen.trajectory:
        Path(chosen.trajectory).write_text(found.to_message(chosen.approach), encoding="utf-8")
    print(_summary(model, found))
    for path in filter(None, (chosen.output, chosen.trajectory)):
        print(plain(f"Wrote {path}."), file=sys.stderr)
    return 0


def _limit(entry):
    """Return name and limit of one entry."""
    return _entry("--velocity-limit", entry, "JOINT=LIMIT", float)


def _range(option, entry):
    """Return name and bounds of one entry."""
    return _entry(option, entry, "JOINT=LOWER:UPPER", lambda text: tuple(float(one) for one in text.split(":", 1)))


def _entry(option, entry, expected, read):
    """Return name and value of one entry of an option."""
    name, _, text = entry.rpartition("=")
    try:
        value = read(text)
    except ValueError:
        name = ""
    if not name:
        raise InputError(f"{option} has {entry!r}, expected {expected}.")
    return name, value


def _summary(model, found):
    """How far each joint goes, how fast, and what it needs."""
    duration = found.time[-1]
    wide = max(len(name) for name in ("joint", *found.joints))
    lines = [
        plain(f"{model.name}: {duration:g} s that excite {', '.join(found.what)}."),
        f"Condition of the regressor: {found.condition:.3g}; below 100 is good.",
        "",
        f"  {'joint':{wide}}       from         to  velocity  of limit    effort  of limit",
    ]
    for k, name in enumerate(found.joints):
        q, speed, effort = found.position[:, k], abs(found.velocity[:, k]).max(), abs(found.effort[:, k]).max()
        lines.append(
            plain(
                f"  {name:{wide}} {q.min():10.3g} {q.max():10.3g} {speed:9.3g} {_part(speed, model.velocity_limit[k]):>9}"
                f" {effort:9.3g} {_part(effort, model.effort_limit[k]):>9}"
            )
        )
    unbounded = [name for name, limit in zip(found.joints, model.effort_limit, strict=True) if not 0.0 < limit < np.inf]
    if unbounded:
        names = ", ".join(unbounded)
        lines += ["", plain(f"Effort limits of {names} are missing: compare their efforts with the data sheet.")]
    lines += ["", "Collisions are not checked: try the trajectory on the simulator first."]
    return "\n".join(lines)


def _part(value, limit):
    return f"{100 * value / limit:.0f} %" if 0.0 < limit < np.inf else "-"


def _show(line, trial, trials, condition):
    if trial % 10 == 0:
        line.show(f"{trial} of {trials}, condition {condition:.3g}")
