# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Blocks of code in the pages. A comment above each block says how tests run it.

``<!-- test: run -->``
    Python blocks of a page share their names; a bash block ends with status 0.
``<!-- test: run until: TEXT -->``
    Run until the output has the text, then interrupt.
``<!-- test: run in the background: NAME, until TEXT, and TEXT -->`` and ``<!-- test: end: NAME,
NAME -->``
    Run in a terminal of its own until it is interrupted; the next block waits for the texts.
``<!-- test: hear: NAME, TEXT -->``
    Wait until the output of a block in the background has the text.
``<!-- test: parameters of monitor -->``
    A parameter file, whose names and values the monitor takes.
``<!-- test: run in a folder of recordings -->``
    In test_programs.py; each line of bash is a command of diag-dynamics, which ends with 0 or 1.
``<!-- test: columns of a table -->``
    A map, with which test_programs.py or test_table_files.py reads a table.
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
    """One block; comments of an end or of an output have no code."""

    language: str
    how: str
    what: str
    code: str
    line: int


def blocks_of(path):
    """Return the blocks of a page in their order; `how` is empty where a comment is missing."""
    text = path.read_text(encoding="utf-8")
    result = []
    for match in FENCE.finditer(text):
        line = text.count("\n", 0, match.start()) + 1
        if match["only"]:
            result.append(Block("", match["only"], match["names"], "", line))
            continue
        how, _, what = (match["how"] or "").partition(": ")
        result.append(Block(match["language"], how, what, match["code"], line))
    return result
