# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What several commands are given alike: recordings, a robot, parameters; and files that are to be written."""

from pathlib import Path

from diag_dynamics.cli.robot_argument import ROBOT
from diag_dynamics.entries import split_arguments
from diag_dynamics.exceptions import InputError
from diag_dynamics.recordings.findings import without_states
from diag_dynamics.recordings.recording import Reading

GAIN = 25.0
"""Of the disturbance observer where no other is given [1/s]."""


def add_arguments(parser):
    """Arguments that say which robot a recording is of, and how it is read."""
    parser.add_argument("--urdf", metavar="ROBOT", help=f"{ROBOT} (default: the bag's own)")
    parser.add_argument("--columns", metavar="MAP.yaml", help="map of the columns of a table (docs/recordings.md)")
    parser.add_argument(
        "--topic",
        action="append",
        help="topic of the joint states, where a bag has several; repeated, as for arm and gripper, it merges them",
    )
    parser.add_argument(
        "--joint-names",
        metavar="NAME=JOINT",
        nargs="+",
        action="extend",
        help="the robot's joint of a name in the recording; * is any text: 'fer_*=panda_*' (docs/recordings.md)",
    )
    add_parameters(parser)
    parser.add_argument("--start", type=float, metavar="SECONDS", help="after the beginning: nothing before is read")
    parser.add_argument(
        "--end", type=float, metavar="SECONDS", help="after the beginning: nothing from there on is read"
    )


def add_parameters(parser):
    """Arguments that set parameters."""
    parser.add_argument(
        "--parameters",
        metavar="FILE.yaml",
        action="append",
        default=[],
        help="of the monitor, or of the robot: friction, rotor inertias, … (docs/library.md); may be repeated",
    )
    parser.add_argument(
        "--set",
        metavar="PARAMETER=VALUE",
        nargs="+",
        action="extend",
        default=[],
        help="parameters of the monitor (docs/parameters.md), as effort_scale='*=0.5'",
    )


def parse_joint_names(chosen):
    """Robot's names of joints by those of the recording, None without any.

    Raises
    ------
    InputError
        One has no =, or a name comes twice.
    """
    found = {}
    for text in chosen.joint_names or ():
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
            raise without_states(self.path, self.findings)


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
