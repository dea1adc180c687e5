# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What somebody at the keys of `top` has chosen."""

from diag_dynamics.views.top.history import LONGEST
from diag_dynamics.views.top.quantities import QUANTITIES

WINDOWS = (5.0, 10.0, 30.0, LONGEST)
"""Times that can be looked at [s]."""

SORTS = "base to tip", "value", "peak", "part of limit"

HELP = (
    ("1 … 6, ← →", "quantity: " + ", ".join(one.name for one in QUANTITIES)),
    ("s", "sort: " + ", ".join(SORTS)),
    ("+ -", "window: " + ", ".join(f"{one:g}" for one in WINDOWS) + " s"),
    ("space", "pause, and go on"),
    ("r", "begin peaks anew"),
    ("/", "joints whose names have this; Enter keeps it, Esc drops it"),
    ("↑ ↓", "scroll joints"),
    ("Tab", "next robot"),
    ("o", "all robots"),
    ("? h", "this page"),
    ("q", "end"),
)
"""Keys, and what they do."""

ESCAPES = {"\x1b[C": "right", "\x1b[D": "left", "\x1b[A": "up", "\x1b[B": "down", "\x1b[Z": "back"}
"""Keys that terminals send as several characters, in either of the two modes."""
ESCAPES |= {name.replace("[", "O"): key for name, key in ESCAPES.items()}


def keys_of(text):
    """Keys in what a terminal has sent: characters, and names of others."""
    keys, at = [], 0
    while at < len(text):
        key = ESCAPES.get(text[at : at + 3])
        if key:
            at += 3
        elif text[at] == "\x1b":
            key, end = "escape", at + 1
            if text[end : end + 1] in ("[", "O"):  # another one, which nobody asked for
                end += 1
                while end < len(text) and not text[end].isalpha() and text[end] != "~":
                    end += 1
                key, end = None, end + 1
            at = end
        else:
            key, at = text[at], at + 1
        if key:
            keys.append(key)
    return keys


class Choices:
    """What is shown, and how; keys change it.

    Attributes
    ----------
    quantity : int
        One of QUANTITIES.
    sort : int
        One of SORTS.
    window : float
        [s]
    paused, help, overview : bool
    wanted : str
        What the names of joints have to have in them.
    typing : bool
        Whether keys go there.
    scroll : int
        Joints above the first that is shown.
    robot : int
        Counts on with Tab; by the number of robots.
    ends, restarts : bool
        Whether somebody wants to end, or peaks to begin anew.
    """

    def __init__(self):
        self.quantity, self.sort, self.window = 0, 0, WINDOWS[1]
        self.paused = self.help = self.overview = self.typing = self.ends = self.restarts = False
        self.wanted, self.scroll, self.robot = "", 0, 0

    def take(self, text):
        """Take what a terminal has sent; returns whether anything may have changed."""
        keys = keys_of(text)
        for key in keys:
            if self.typing:
                self._type(key)
            else:
                self._press(key)
        return bool(keys)

    def _type(self, key):
        if key in ("\r", "\n"):
            self.typing = False
        elif key in ("escape", "\x03"):
            self.typing, self.wanted = False, ""
        elif key in ("\x7f", "\b"):
            self.wanted = self.wanted[:-1]
        elif len(key) == 1 and key.isprintable():
            self.wanted += key
        self.scroll = 0

    def _press(self, key):
        if self.help and key in ("escape", "q"):
            self.help = False
        elif key in "123456":
            self.quantity = int(key) - 1
        elif key in ("right", "left"):
            self.quantity = (self.quantity + (1 if key == "right" else -1)) % len(QUANTITIES)
        elif key in ("+", "=", "-"):
            at = WINDOWS.index(self.window) + (-1 if key == "-" else 1)
            self.window = WINDOWS[min(max(at, 0), len(WINDOWS) - 1)]
        elif key in ("up", "down"):
            self.scroll = max(0, self.scroll + (1 if key == "down" else -1))
        elif key in ("\t", "n", "back"):
            self.robot += -1 if key == "back" else 1
        else:
            self._switch(key)

    def _switch(self, key):
        if key == "s":
            self.sort = (self.sort + 1) % len(SORTS)
        elif key in (" ", "p"):
            self.paused = not self.paused
        elif key in ("?", "h"):
            self.help = not self.help
        elif key == "o":
            self.overview = not self.overview
        elif key == "r":
            self.restarts = True
        elif key == "/":
            self.typing, self.scroll = True, 0
        elif key == "escape":
            self.wanted, self.scroll = "", 0
        elif key in ("q", "\x03"):
            self.ends = True
