# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What several commands have alike: errors, options, recordings, a robot, parameters, progress, files to be written."""

import sys
from functools import wraps
from pathlib import Path

from diag_dynamics.cli.robot_argument import ROBOT, robot_of
from diag_dynamics.entries import split_arguments
from diag_dynamics.exceptions import DiagDynamicsError, InputError
from diag_dynamics.parameters.files import parameters_of
from diag_dynamics.parameters.monitor import PARAMETERS
from diag_dynamics.parameters.robots import model_of
from diag_dynamics.recordings.findings import no_states_error
from diag_dynamics.recordings.recording import Reading

GAIN = 25.0
"""Of the disturbance observer where no other is given [1/s]."""

FAILED = 2
"""Exit status of a command with an error."""


def reported(run):
    """Return a command that prints its errors on stderr, with the exit status :data:`FAILED`."""

    @wraps(run)
    def command(name, arguments):
        try:
            return run(name, arguments)
        except BrokenPipeError:
            raise  # of `… | head`, which main handles
        except (DiagDynamicsError, OSError) as error:
            print(f"diag-dynamics {name}: {error}", file=sys.stderr)
            return FAILED

    return command


def add_entries(parser, option, metavar, text):
    """Add an option of several entries, which may be repeated."""
    parser.add_argument(option, metavar=metavar, nargs="+", action="extend", default=[], help=text)


def add_arguments(parser):
    """Add the options that say which robot a recording is of, and how it is read."""
    parser.add_argument("--urdf", metavar="ROBOT", help=f"{ROBOT} (default: the bag's own)")
    parser.add_argument("--columns", metavar="MAP.yaml", help="map of the columns of a table (docs/recordings.md)")
    text = "topic of the joint states, where a bag has several; repeated, as for arm and gripper, it merges them"
    parser.add_argument("--topic", action="append", help=text)
    text = "the robot's joint of a name in the recording; * is any text: 'fer_*=panda_*' (docs/recordings.md)"
    add_entries(parser, "--joint-names", "NAME=JOINT", text)
    add_parameters(parser)
    for option, what in (("--start", "nothing before is read"), ("--end", "nothing from there on is read")):
        parser.add_argument(option, type=float, metavar="SECONDS", help=f"after the beginning: {what}")


def add_parameters(parser):
    """Add the options that set parameters."""
    text = "of the monitor, or of the robot: friction, rotor inertias, … (docs/library.md); may be repeated"
    parser.add_argument("--parameters", metavar="FILE.yaml", action="append", default=[], help=text)
    text = "parameters of the monitor (docs/parameters.md), as effort_scale='*=0.5'"
    add_entries(parser, "--set", "PARAMETER=VALUE", text)


def chosen_model(chosen):
    """Return the model of the robot and the parameters that were chosen."""
    values = {name: spec.default for name, spec in PARAMETERS.items()} | parameters_of(chosen.parameters, chosen.set)
    return model_of(robot_of(chosen.urdf, chosen.xacro_args), values)


class Progress:
    """A line on stderr that each call replaces, where that is a terminal.

    Parameters
    ----------
    quiet : bool
        Whether nothing is shown.
    """

    def __init__(self, quiet=False):
        self._shown = not quiet and sys.stderr.isatty()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.show("")

    def show(self, text):
        """Replace the line."""
        if self._shown:
            print(f"\r\033[K{text}", end="", file=sys.stderr, flush=True)


def parse_joint_names(chosen):
    """Robot's names of joints by those of the recording, None without any.

    Raises
    ------
    InputError
        One has no =, or a name comes twice.
    """
    found = {}
    for text in chosen.joint_names:
        name, equals, joint = text.partition("=")
        if not equals or found.setdefault(name.strip(), joint.strip()) != joint.strip():
            raise InputError(f"--joint-names has {text!r}; expected NAME=JOINT, each name once.")
    return found or None


def reading_arguments(chosen):
    """Arguments of :class:`Reading` that say how a recording is read."""
    return {
        "columns": chosen.columns,
        "topic": chosen.topic,
        "joint_names": parse_joint_names(chosen),
        "start": chosen.start,
        "end": chosen.end,
    }


def gain_of(chosen):
    """The disturbance observer's gain where the parameter external_torque.gain is not set [1/s]."""
    return GAIN if chosen.gain is None else chosen.gain


class Streamed:
    """A recording that is read piece by piece whenever its pieces are wanted, in bounded memory.

    Parameters
    ----------
    path : str
    robot : RobotModel, str or None
        As of :class:`Reading`.
    how : dict
        Further arguments of it.

    Attributes
    ----------
    path : str
    model : RobotModel
    findings : list of Finding
        Of all that has been read.
    """

    def __init__(self, path, robot, how):
        self.path, self.findings, self._how = path, [], how
        self.model = Reading(path, robot, **how).model

    def pieces(self):
        """Yield the pieces, each a Recording.

        Raises
        ------
        InputError
            There is not a single state in them.
        """
        states = 0
        for piece in Reading(self.path, self.model, **self._how).pieces():
            self.findings, states = piece.findings, states + len(piece)
            yield piece
        if not states:
            raise no_states_error(self.path, self.findings)


def streamed(chosen, paths, parameters, robot):
    """Recordings that were given, each Streamed, and all of the robot of the first one.

    Raises
    ------
    InputError
        One cannot be read.
    """
    how, found = reading_arguments(chosen), []
    for path in paths:
        found.append(Streamed(path, found[0].model if found else robot, how | {"parameters": parameters}))
    return found


def refuse_outputs(read, written):
    """Refuse to write over what is read, twice into one file, and where there is no folder.

    Parameters
    ----------
    read : iterable of str or None
        Paths.
    written : dict
        Path, or None, by option; ``-`` is stdout.

    Raises
    ------
    InputError
        It names the option.
    """
    taken = {_place(split_arguments(path)[0]): f"'{path}' is read" for path in read if path}
    outputs = {}
    for option, path in written.items():
        if path in (None, "-"):
            continue
        full = _place(path, option)
        if (
            full.exists() and not full.is_file() and not full.is_dir()
        ):  # a pipe, or /dev/null: one may have several outputs
            continue
        for other, what in taken.items():  # of a folder, its files too
            if full == other or other in full.parents:
                raise InputError(f"{option} '{path}': {what}, so nothing is written there.")
        if not full.parent.is_dir():
            raise InputError(f"{option} '{path}': there is no folder '{full.parent}'.")
        taken[full] = f"{option} is written into it"
        outputs[full] = option
    for full, option in outputs.items():
        if (other := outputs.get(full.with_name(f"{full.name}.part"))) is not None:  # see Part
            raise InputError(f"{option} '{written[option]}' has the name that {other} was given while it is written.")


def _place(path, option=None):
    """Where a path leads to."""
    try:
        return Path(path).expanduser().resolve()
    except (OSError, RuntimeError, ValueError) as error:  # a link that leads to itself, no home, a NUL
        raise InputError(f"{option + ' ' if option else ''}'{path}': {error}.") from None
