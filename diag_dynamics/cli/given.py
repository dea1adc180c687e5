# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What several commands are given alike: recordings, a robot, parameters; and files that are to be written."""

from pathlib import Path

from diag_dynamics.exceptions import InputError
from diag_dynamics.model.named import robot_path
from diag_dynamics.recordings.account import without_states
from diag_dynamics.recordings.recording import Reading, read_recording


def add_arguments(parser):
    """Arguments that say which robot a recording is of, and how it is read."""
    parser.add_argument(
        "--urdf", help="the robot: URDF, or a name that `diag-dynamics robots` lists (default: the bag's own)"
    )
    parser.add_argument("--columns", metavar="MAP.yaml", help="map of the columns of a table (docs/recordings.md)")
    parser.add_argument("--topic", help="topic of the joint states, where a bag has several")
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
        help="parameters of the monitor (docs/parameters.md), as effort_scale=*=0.5",
    )


def robot_of(urdf):
    """What the robot is made of: a file, that of an example by its name."""
    if urdf is None or Path(urdf).expanduser().is_file() or "/" in urdf or "." in urdf:
        return urdf
    return str(robot_path(urdf))  # the parameters shape it, as they do a file


def recordings_of(chosen, paths, parameters, robot, most=None):
    """Recordings, each with states, `most` at most; all of the robot of the first one, where none is given.

    Raises
    ------
    InputError
        One cannot be read, or has not a single state.
    """
    recordings = []
    for path in paths:
        described = robot is None and recordings
        one = read_recording(
            path,
            recordings[0].model if described else robot,
            chosen.columns,
            topic=chosen.topic,
            parameters=None if described else parameters,
            start=chosen.start,
            end=chosen.end,
            most=most,
        )
        if not len(one):
            raise without_states(path, one.findings)
        recordings.append(one)
    return recordings


class Streamed:
    """Pieces of a recording, read when they are wanted, in bounded memory.

    Parameters
    ----------
    path : str
    reading : Reading

    Attributes
    ----------
    path : str
    model : RobotModel
    findings : list of Finding
        Of all that has been read.
    """

    def __init__(self, path, reading):
        self.path, self.model, self.findings, self._reading = path, reading.model, [], reading

    def __iter__(self):
        states = 0
        for piece in self._reading.pieces():
            self.findings, states = piece.findings, states + len(piece)
            yield piece
        if not states:
            raise without_states(self.path, self.findings)


def streamed(chosen, paths, parameters, robot):
    """The same as :func:`recordings_of`, to be read piece by piece: whether there are states is known then.

    Raises
    ------
    InputError
        One cannot be read.
    """
    found = []
    for path in paths:
        described = robot is None and found
        reading = Reading(
            path,
            found[0].model if described else robot,
            chosen.columns,
            topic=chosen.topic,
            parameters=None if described else parameters,
            start=chosen.start,
            end=chosen.end,
        )
        found.append(Streamed(path, reading))
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
    taken = {Path(path).expanduser().resolve(): f"'{path}' is read" for path in read if path}
    for option, path in written.items():
        if path in (None, "-"):
            continue
        full = Path(path).expanduser().resolve()
        for other, what in taken.items():  # of a folder, its files too
            if full == other or other in full.parents:
                raise InputError(f"{option} '{path}': {what}, so nothing is written there.")
        if not full.parent.is_dir():
            raise InputError(f"{option} '{path}': there is no folder '{full.parent}'.")
        taken[full] = f"{option} is written into it"
