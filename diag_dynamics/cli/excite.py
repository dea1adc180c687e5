# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""`diag-dynamics excite`: a trajectory to identify friction, rotor inertias and inertias."""

from diag_dynamics.atomic_file import write_text
from diag_dynamics.cli import common
from diag_dynamics.entries import assignments
from diag_dynamics.exceptions import InputError
from diag_dynamics.identification.excitation import excite
from diag_dynamics.text import Progress, aligned, plain

EPILOG = (
    "Collisions are not checked. Try the trajectory on the simulator first, "
    "limit the motion by --range, and start with a low --velocity."
)

OUTPUTS = {"-o": "output", "--trajectory": "trajectory"}

NUMBERS = {  # options with a number: type, default and help
    "--duration": (float, 20.0, "duration [s], a whole number of periods"),
    "--period": (float, 10.0, "period of the Fourier series [s]"),
    "--velocity": (float, 0.5, "maximum velocity as a fraction of the limits"),
    "--effort": (float, 0.7, "maximum effort as a fraction of the limits"),
    "--rate": (float, 50.0, "points per second [1/s]"),
    "--trials": (int, 300, "number of random trajectories"),
    "--seed": (int, 0, "seed of the random trajectories"),
    "--approach": (float, 5.0, "time to the first point [s]"),
}


def add_arguments(parser):
    """Declare the arguments."""
    common.add_robot(parser)
    parser.add_argument(
        "--what", default="friction,rotors", help="as for identify (default: %(default)s)"
    )
    for option, (kind, default, text) in NUMBERS.items():
        parser.add_argument(
            option, type=kind, default=default, help=f"{text} (default: %(default)g)"
        )
    parser.add_argument("--joints", help="joints that move, separated by commas (default: all)")
    common.add_entries(
        parser,
        "--range",
        "JOINT=LOWER:UPPER",
        "range of a joint's position [rad, m]; * for all joints without limits in the file",
    )
    text = "limit of a joint without one in its file [rad/s, m/s]; * for all such joints"
    common.add_entries(parser, "--velocity-limit", "JOINT=LIMIT", text)
    common.add_parameters(parser)
    parser.add_argument(
        "-o", "--output", metavar="OUT.json", help="times, positions, velocities, efforts"
    )
    parser.add_argument(
        "--trajectory",
        metavar="OUT.yaml",
        help="JointTrajectory, for the controller's mode tracking",
    )


def run(chosen):
    """Write a trajectory; return the exit status."""
    if not (chosen.output or chosen.trajectory):
        raise InputError("output is missing; expected -o OUT.json or --trajectory OUT.yaml.")
    model = common.chosen_model(chosen)
    numbers = "duration", "period", "velocity", "effort", "rate", "trials", "seed"
    with Progress() as progress:
        trajectory = excite(
            model,
            chosen.what.split(","),
            joints=None if chosen.joints is None else chosen.joints.split(","),
            ranges=_parse_ranges(chosen.range),
            velocity_limits=assignments("--velocity-limit", chosen.velocity_limit),
            progress=lambda trial, condition: progress.show(
                f"{trial} of {chosen.trials}, condition {condition:.3g}"
            ),
            **{name: getattr(chosen, name) for name in numbers},
        )
    if chosen.output:
        write_text(chosen.output, trajectory.to_json())
    if chosen.trajectory:
        write_text(chosen.trajectory, trajectory.to_message(chosen.approach))
    print("\n".join(map(plain, _summary(model, trajectory))))
    common.report_written(chosen.output, chosen.trajectory)
    return common.DONE


def _parse_ranges(entries):
    """Return lower and upper bound by joint of the entries of --range."""
    ranges = {}
    for name, text in assignments("--range", entries, str).items():
        try:
            lower, upper = map(float, text.split(":"))
        except ValueError:
            raise InputError(f"--range has '{name}={text}'; expected JOINT=LOWER:UPPER.") from None
        ranges[name] = lower, upper
    return ranges


def _summary(model, trajectory):
    """Return the lines of the summary: range, velocity and effort of each joint."""
    rows = [["joint", "from", "to", "velocity", "effort"]]
    columns = trajectory.position, trajectory.velocity, trajectory.effort
    for name, q, qd, tau in zip(trajectory.joints, *(x.T for x in columns), strict=True):
        numbers = q.min(), q.max(), abs(qd).max(), abs(tau).max()
        rows.append([name, *(f"{number:.3g}" for number in numbers)])
    lines = [
        f"{model.name}: a trajectory of {trajectory.time[-1]:g} s for "
        f"{', '.join(trajectory.what)}.",
        f"Condition number of the regressor: {trajectory.condition:.3g} (below 100 is good).",
        "",
        *aligned(rows),
    ]
    return [*lines, "", "Collisions are not checked: try the trajectory on the simulator first."]
