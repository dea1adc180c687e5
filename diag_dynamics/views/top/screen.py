# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The terminal that `top` has for itself: a screen of its own, keys without Enter, and all as it was afterwards."""

import codecs
import os
import select
import signal
import sys
import termios
import tty

_ENTER, _LEAVE = "\x1b[?1049h\x1b[?25l\x1b[2J", "\x1b[0m\x1b[?25h\x1b[?1049l"


def is_dumb(environment=None):
    """Whether a terminal can do nothing but write line after line, or is none."""
    environment = os.environ if environment is None else environment
    return not sys.stdout.isatty() or environment.get("TERM", "dumb") in ("", "dumb", "unknown")


def has_colours(environment=None):
    """Whether colours are wanted: https://no-color.org."""
    environment = os.environ if environment is None else environment
    return not environment.get("NO_COLOR")


def is_fancy(stream=None):
    """Whether blocks and braille can be written."""
    try:
        "▁⣿½".encode(getattr(stream or sys.stdout, "encoding", None) or "ascii")
    except (LookupError, UnicodeEncodeError):
        return False
    return True


class Screen:
    """See the module. Lines that stay as they were are not written again.

    Parameters
    ----------
    out : int
        File descriptor of the terminal.
    keys : int or None
        That of the keyboard; None: there is none.
    """

    def __init__(self, out=1, keys=0):
        self._out, self._keys = out, keys if keys is not None and os.isatty(keys) else None
        self._encoding = getattr(sys.stdout, "encoding", None) or "utf-8"
        self._decoder = codecs.getincrementaldecoder("utf-8")(errors="replace")
        self._before, self._size = [], None
        self._mode = termios.tcgetattr(self._keys) if self._keys is not None else None
        self._handlers = {}
        for number, handler in ((signal.SIGTSTP, self._stopped), (signal.SIGCONT, self._continued)):
            self._handlers[number] = signal.signal(number, handler)
        self._enter()

    def _enter(self):
        if self._mode is not None:
            tty.setcbreak(self._keys, termios.TCSANOW)
        self._before = []
        self._write(_ENTER)

    def close(self):
        """Give the terminal back as it was."""
        for number, handler in self._handlers.items():
            signal.signal(number, handler)
        self._handlers = {}
        self._leave()

    def _leave(self):
        self._write(_LEAVE)
        if self._mode is not None:
            termios.tcsetattr(self._keys, termios.TCSANOW, self._mode)

    def _stopped(self, *_):
        """Ctrl-Z: the shell gets its screen back."""
        self._leave()
        signal.signal(signal.SIGTSTP, signal.SIG_DFL)
        os.kill(os.getpid(), signal.SIGTSTP)

    def _continued(self, *_):
        signal.signal(signal.SIGTSTP, self._stopped)
        self._enter()

    @property
    def size(self):
        """Columns and lines."""
        try:
            columns, lines = os.get_terminal_size(self._out)
        except OSError:
            columns, lines = 80, 24
        return max(columns, 1), max(lines, 2)

    def typed(self):
        """What has been typed since the last time; an end of the keyboard is a `q`."""
        if self._keys is None or not select.select([self._keys], [], [], 0.0)[0]:
            return ""
        try:
            data = os.read(self._keys, 1024)
        except OSError:
            data = b""
        return self._decoder.decode(data) if data else "q"

    def show(self, lines):
        """Write the lines that have changed."""
        if self.size != self._size:
            self._size, self._before = self.size, []
            self._write("\x1b[2J")
        before = self._before + [None] * (len(lines) - len(self._before))
        changed = [f"\x1b[{k + 1};1H\x1b[2K{line}\x1b[0m" for k, line in enumerate(lines) if line != before[k]]
        self._before = list(lines)
        if changed:
            self._write("".join(changed))

    def _write(self, text):
        data = text.encode(self._encoding, "replace")
        while data:
            try:
                data = data[os.write(self._out, data) :]
            except BlockingIOError:
                select.select([], [self._out], [], 1.0)
            except OSError:  # nobody looks any more
                return
