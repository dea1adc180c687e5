# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""`diag-dynamics demo-identify`: from a model that is wrong to alarms that work, on simulated robots."""

import contextlib
import sys
import tempfile
from pathlib import Path

from diag_dynamics.demos.wrong_model import ROBOTS, picture, story_of, text_of
from diag_dynamics.exceptions import InputError
from diag_dynamics.text import plain


def add_arguments(parser):
    """Declare the arguments."""
    parser.add_argument("--robots", default=",".join(ROBOTS), help=f"some of {', '.join(ROBOTS)} (default: all)")
    parser.add_argument(
        "--off", type=float, default=0.3, help="by which part inertias are off from the URDF's (default: 0.3)"
    )
    parser.add_argument("--seed", type=int, default=1, help="of chance (default: 1)")
    parser.add_argument("--picture", metavar="PICTURE.png", help="where the picture goes")
    parser.add_argument("--keep", metavar="FOLDER", help="keeps recordings, arm.yaml and alarms.yaml there")


def run(chosen):
    """Tell the story; return the exit status: 1 if the identified model sees fewer than nine of ten pushes."""
    names = chosen.robots.split(",")
    for one in names:
        if one not in ROBOTS:
            raise InputError(f"--robots has '{one}', expected some of {', '.join(ROBOTS)}.")
    with contextlib.ExitStack() as stack:
        folder = chosen.keep or stack.enter_context(tempfile.TemporaryDirectory())
        Path(folder).mkdir(parents=True, exist_ok=True)
        stories = []
        for one in names:
            print(f"{one}: recordings are computed, identified and judged, some twenty seconds …", file=sys.stderr)
            stories.append(story_of(one, folder, off=chosen.off, seed=chosen.seed))
            print("\n".join(map(plain, text_of(stories[-1]))), flush=True)
    if chosen.picture:
        picture(stories, chosen.picture)
        print(plain(f"Wrote {chosen.picture}."), file=sys.stderr)
    if chosen.keep:
        print(plain(f"Recordings and files are in {chosen.keep}."), file=sys.stderr)
    return 0 if all(10 * story.after.seen >= 9 * len(story.pushes) for story in stories) else 1
