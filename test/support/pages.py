# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Blocks of code in the pages, and what is to be done with each: it stands in a comment above.

``<!-- test: run -->``
    Python blocks of a page share their names; one of bash has to end with status 0.
``<!-- test: run until: TEXT -->``
    Until the text has been printed; then it is interrupted, if it has not ended.
``<!-- test: run in the background: NAME, until TEXT, and TEXT -->`` and ``<!-- test: end: NAME, NAME -->``
    What somebody starts in a terminal of its own, and ends by Ctrl-C; what follows waits until the texts were printed.
``<!-- test: hear: NAME, TEXT -->``
    Waits until what runs in the background has printed the text.
``<!-- test: parameters of NODE -->``
    A parameter file: every name and value is one that the node takes.
``<!-- test: run in a folder of recordings -->``
    By test_snippets.py; of bash each line is a command of diag-dynamics, which ends with 0 or 1.
``<!-- test: columns of a table -->``
    A map, by which test_snippets.py reads one.
``<!-- test: not run: REASON -->``
"""

import re
from typing import NamedTuple

FENCE = re.compile(
    r"(?:<!-- test: (?P<how>[^>]*?) -->\n)?^(?P<fence>```)(?P<language>\w+)\n(?P<code>.*?)^```$"
    r"|^<!-- test: (?P<only>end|hear): (?P<names>[^>]*?) -->$",
    re.S | re.M,
)


class Block(NamedTuple):
    """One block; of an end or what is heard no code."""

    language: str
    how: str
    what: str
    code: str
    line: int


def blocks_of(path):
    """Return the blocks of a page, in their order; `how` is empty where none is said."""
    text = path.read_text(encoding="utf-8")
    found = []
    for match in FENCE.finditer(text):
        line = text.count("\n", 0, match.start()) + 1
        if match["only"]:
            found.append(Block("", match["only"], match["names"], "", line))
            continue
        how, _, what = (match["how"] or "").partition(": ")
        found.append(Block(match["language"], how, what, match["code"], line))
    return found
