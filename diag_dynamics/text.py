# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Text for people: names without control characters, numbers, durations, a line of progress."""

import math
import sys
import time
from collections.abc import Iterable, Sequence

MAX_LENGTH = 900
"""Maximum length of an error's text; with its prefix a line of the log has 1,000 characters."""

MAX_NAMES = 8  # names that a text has

UNKNOWN = "-"
"""Text of an unknown number."""


def listed(names: Iterable[object], most: int = MAX_NAMES) -> str:
    """Return names separated by commas, the first `most` of many and the number of others."""
    names = list(map(str, names))
    rest = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + rest


def plain(text: str) -> str:
    r"""Return the text with control characters escaped, as ``\x1b`` or ``\u202e``.

    Letters of all languages stay, and so do escapes: a second call changes nothing.
    """
    return "".join(
        character if character.isprintable() else character.encode("unicode_escape").decode()
        for character in text
    )


def shortened(text: str, most: int = MAX_LENGTH) -> str:
    """Return a text as :func:`plain` does, its begin and end alone if it is longer than `most`."""
    head = plain(text[:most])
    tail = plain(text[-most:])
    if len(text) <= most and len(head) <= most:
        return head
    gap = f" … ({len(text)} characters) … "
    size = (most - len(gap)) // 2
    return head[:size] + gap + tail[-size:]


def short(value: object) -> str:
    """Return a value as messages show it."""
    return shortened(repr(value), 80)


def number(value: float) -> str:
    """Return a number with three significant digits in ASCII, as web/src/format.js does.

    :data:`UNKNOWN` for NaN and infinity; with an exponent from 10⁵ on and below 10⁻³.
    """
    if not math.isfinite(value):
        return UNKNOWN
    if value == 0.0:
        return "0"
    size = abs(value)
    if size >= 1e5 or size < 1e-3:
        mantissa, exponent = f"{value:.1e}".split("e")
        return f"{mantissa}e{int(exponent)}"
    rounded = float(f"{size:.2e}")  # 9.997 has as many decimals as 10.0
    decimals = max(0, 2 - math.floor(math.log10(rounded)))
    return f"{value:.{min(decimals, 4)}f}"


def distinct(*values: float, digits: int = 6) -> list[str]:
    """Return numbers with `digits` significant digits, or more that tell different ones apart."""
    different = len({float(value) for value in values})
    for count in range(digits, 18):  # 17 digits tell all doubles apart
        texts = [f"{value:.{count}g}" for value in values]
        if len(set(texts)) >= different:
            break
    return texts


def aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """Return a line for each row of texts: the first column aligned left, all others right."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        "  ".join([first.ljust(widths[0]), *map(str.rjust, texts, widths[1:])])
        for first, *texts in rows
    ]


class Progress:
    """Context that shows its latest line on stderr, at most five times a second on a terminal.

    Elsewhere it shows nothing, or every line with `lines`.
    """

    PERIOD = 0.2

    def __init__(self, quiet=False, lines=False):
        self._on_terminal = sys.stderr.isatty()
        self._last = -self.PERIOD
        self.is_shown = not quiet and (self._on_terminal or lines)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.is_shown and self._on_terminal:
            print("\r\033[K", end="", file=sys.stderr, flush=True)

    def show(self, text):
        """Show a line."""
        now = time.monotonic()
        if not self.is_shown or (self._on_terminal and now - self._last < self.PERIOD):
            return
        self._last = now
        start, end = ("\r\033[K", "") if self._on_terminal else ("", "\n")
        print(f"{start}{plain(text)}", end=end, file=sys.stderr, flush=True)
