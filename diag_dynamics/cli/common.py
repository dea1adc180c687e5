# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Options, errors, signals, progress and outputs of all commands.

Modules that compute are imported when used.
"""

import argparse
import json
import signal
import sys
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from shlex import quote

from diag_dynamics.entries import ARGUMENT, Parser, assignments, split_arguments
from diag_dynamics.exceptions import DiagDynamicsError, InputError
from diag_dynamics.text import plain, shortened

DONE, DOUBTFUL, FAILED = range(3)  # exit statuses: success; a result with reservations; no result

INTERRUPTED, TERMINATED = 128 + signal.SIGINT, 128 + signal.SIGTERM  # as shells report

GAIN = 25.0  # default gain of the disturbance observer [1/s]

ROBOT = (
    "robot: a URDF, xacro or MJCF file, or a name listed by `diag-dynamics robots`. "
    "Add xacro arguments as NAME:=VALUE"
)

READ = ("recording", "reference", "urdf", "columns", "alarms", "parameters")
"""Arguments that name files to be read."""


def run_command(name, about, module, arguments):
    """Parse the arguments of a command of the library, run its module, return the exit status."""
    epilog = getattr(module, "EPILOG", None)
    parser = Parser(prog=f"diag-dynamics {name}", description=about, epilog=epilog)
    module.add_arguments(parser)
    chosen = parse_arguments(parser, arguments)
    outputs = {
        option: getattr(chosen, dest) for option, dest in getattr(module, "OUTPUTS", {}).items()
    }
    handler = signal.signal(signal.SIGTERM, _terminate)
    try:
        check_outputs(chosen, outputs)
        return module.run(chosen)
    except BrokenPipeError:
        raise  # of `… | head`, which main handles
    except KeyboardInterrupt as error:
        print(f"diag-dynamics {name}: interrupted.", file=sys.stderr)
        return TERMINATED if error.args else INTERRUPTED
    except (DiagDynamicsError, OSError) as error:
        report_error(name, error, chosen)
        return FAILED
    finally:
        signal.signal(signal.SIGTERM, handler)


def _terminate(number, _):
    """Clean up at SIGTERM as at Ctrl-C."""
    raise KeyboardInterrupt(number)


def report_error(name, error, chosen):
    """Print the error of a command; the commands in its text name the command's robot."""
    text, robot = str(error), getattr(chosen, "urdf", None)
    if robot is not None:
        arguments = " ".join(map(quote, [robot, *chosen.xacro_args]))
        text = text.replace("--urdf ROBOT", f"--urdf {arguments}")
    print(f"diag-dynamics {name}: {shortened(text)}", file=sys.stderr)


# --- Arguments


def parse_arguments(parser, arguments):
    """Parse a command line; xacro arguments stand anywhere and are `xacro_args` of the result."""
    chosen, left = parser.parse_known_args(
        [word for word in arguments if not ARGUMENT.fullmatch(word)]
    )
    chosen.xacro_args = [word for word in arguments if ARGUMENT.fullmatch(word)]
    if not hasattr(chosen, "urdf"):
        left += chosen.xacro_args
    if left:
        parser.error(f"unrecognized arguments: {' '.join(left)}")
    return chosen


def add_entries(parser, option, metavar, text):
    """Add an option of several entries, which may be repeated."""
    parser.add_argument(option, metavar=metavar, nargs="+", action="extend", default=[], help=text)


def add_recording(parser, text, nargs="+"):
    """Add recordings and the options of how they are read."""
    parser.add_argument("recording", nargs=nargs, help=text)
    parser.add_argument("--urdf", metavar="ROBOT", help=f"{ROBOT} (default: the robot in the bag)")
    parser.add_argument(
        "--columns",
        metavar="MAP.yaml",
        help="column map of a table; analyse writes one to fill in if there is no such file",
    )
    parser.add_argument(
        "--topic", action="append", help="topic of joint states; repeat it to merge several"
    )
    text = (
        "map a name in the recording to a joint of the robot; * matches any text: 'fer_*=panda_*'"
    )
    add_entries(parser, "--joint-names", "NAME=JOINT", text)
    add_parameters(parser)
    for option, effect in (("--start", "ignore earlier data"), ("--end", "ignore later data")):
        text = f"{effect}; seconds from the beginning of the recording"
        parser.add_argument(option, type=float, metavar="SECONDS", help=text)


def add_robot(parser):
    """Add the robot as an argument."""
    parser.add_argument("urdf", metavar="ROBOT", help=ROBOT)


def add_parameters(parser):
    """Add the options that set parameters."""
    text = (
        "file with parameters of the monitor or of the robot, or its loops (docs/library.md); "
        "repeatable"
    )
    parser.add_argument("--parameters", metavar="FILE.yaml", action="append", default=[], help=text)
    add_entries(
        parser,
        "--set",
        "PARAMETER=VALUE",
        "set parameters of the monitor, such as effort_scale='*=0.5'",
    )


def add_quiet(parser):
    """Add the option --quiet."""
    parser.add_argument("--quiet", action="store_true", help="print errors only")


def add_threads(parser):
    """Add the option --threads."""
    parser.add_argument(
        "--threads", type=positive_int, help="number of threads (default: number of processors)"
    )


def positive_int(text):
    """Return a whole number of at least 1, as a type of argparse."""
    if int(text) < 1:
        raise argparse.ArgumentTypeError(f"value is {text}; expected at least 1")
    return int(text)


# --- Robot, parameters and recordings of the options


def chosen_robot(chosen):
    """Return the path of the robot with its xacro arguments; None if none is named."""
    from diag_dynamics.description.catalog import robot_source

    if chosen.urdf is not None:
        return robot_source(chosen.urdf, chosen.xacro_args)
    if chosen.xacro_args:
        argument = chosen.xacro_args[0]
        raise InputError(
            f"'{argument}' is a xacro argument, but --urdf is missing. Give --urdf FILE.xacro."
        )
    return None


def chosen_parameters(chosen, *files):
    """Return parameters of the monitor by name, of all files and of --set."""
    from diag_dynamics.parameters.files import parameters_of

    return parameters_of([*chosen.parameters, *files], chosen.set)


def chosen_model(chosen):
    """Return the model of the robot with the parameters."""
    from diag_dynamics.parameters.monitor import PARAMETERS
    from diag_dynamics.parameters.robot_models import model_of

    defaults = {name: spec.default for name, spec in PARAMETERS.items()}
    return model_of(chosen_robot(chosen), defaults | chosen_parameters(chosen))


def reading_options(chosen):
    """Return the arguments of :class:`Reading` but path, robot and parameters."""
    options = {name: getattr(chosen, name) for name in ("columns", "topic", "start", "end")}
    options["joint_names"] = assignments("--joint-names", chosen.joint_names, str) or None
    return options


def expand_recordings(paths):
    """Return paths of recordings with all episodes of a LeRobot dataset in place of its folder."""
    from diag_dynamics.recordings.tables import is_dataset

    if not any(map(is_dataset, paths)):
        return paths
    from diag_dynamics.recordings.tables.lerobot import expand_episodes

    return expand_episodes(paths)


def stream_recordings(chosen, paths, parameters, robot, progress):
    """Return the model, and for each path a function that yields pieces of its recording.

    All recordings are of the robot of the first one.
    """
    from diag_dynamics.recordings.recording import Reading

    read = partial(Reading, parameters=parameters, **reading_options(chosen))
    readers = []
    for path in expand_recordings(paths):
        robot = read(path, robot).model
        readers.append(partial(_pieces, read, path, robot, progress))
    return robot, readers


def _pieces(read, path, model, progress):
    """Yield Recordings; raise InputError without any state."""
    reading = read(path, model)
    states = 0
    for piece in reading.pieces():
        states = states + len(piece)
        progress.show(f"{path}: {states} states")
        yield piece
    if not states:
        raise reading.no_states_error()


# --- Outputs


def report_written(*paths):
    """Print which files were written; those that are None or - were not."""
    for path in paths:
        if path not in (None, "-"):
            print(plain(f"Wrote {path}."), file=sys.stderr)


@contextmanager
def json_output(path):
    """Yield a function that writes a document as JSON; ``-`` is stdout, None nothing.

    The file is created first.
    """
    from diag_dynamics.atomic_file import AtomicFile

    file = AtomicFile(path) if path and path != "-" else None

    def write(document):
        text = json.dumps(document, indent=1, allow_nan=False)
        if file:
            file.write_text(text)
        elif path == "-":
            print(text)

    try:
        yield write
    except BaseException:
        if file:
            file.discard()
        raise


def check_outputs(chosen, outputs):
    """Reject outputs that are inputs, two outputs into one file, and folders that do not exist."""
    files = {}
    for name in READ:
        paths = getattr(chosen, name, None) or []
        for path in [paths] if isinstance(paths, str) else paths:
            for part in path.split("+"):  # tables side by side
                files[_resolve(split_arguments(part)[0])] = f"'{part}' is an input"
    for option, path in outputs.items():
        full = None if path in (None, "-") else _resolve(path)
        if full is None or (full.exists() and not full.is_file() and not full.is_dir()):
            continue  # several outputs may share a pipe or /dev/null
        for file, use in files.items():
            if full == file or file in full.parents:
                raise InputError(f"{option} is '{path}', but {use}. Choose another file.")
        folder = full if path.endswith("/") else full.parent
        if not folder.is_dir():
            raise InputError(f"{option} is '{path}', but there is no folder '{folder}'.")
        files[full] = f"{option} writes this file"


def _resolve(path):
    try:
        return Path(path).expanduser().resolve()
    except (OSError, RuntimeError, ValueError) as error:  # a link to itself, no home, a null byte
        raise InputError(f"'{path}': {error}.") from None
