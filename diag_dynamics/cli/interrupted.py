# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Commands that are ended while they write: no half of a file stays, and what is not written is said."""

import signal
import sys
import threading
from contextlib import contextmanager


class Terminated(KeyboardInterrupt):
    """SIGTERM came: as Ctrl-C, but for the exit status, which shells have so."""

    status = 128 + signal.SIGTERM


@contextmanager
def terminable():
    """Have SIGTERM clean up as Ctrl-C does."""
    is_main = threading.current_thread() is threading.main_thread()
    before = signal.signal(signal.SIGTERM, _raise) if is_main else None
    try:
        yield
    finally:
        if is_main:
            signal.signal(signal.SIGTERM, before if before is not None else signal.SIG_DFL)


@contextmanager
def orderly(command, paths=()):
    """Have SIGTERM clean up as Ctrl-C does, and tell of what is not written then.

    Parameters
    ----------
    command : str
        Name of the command.
    paths : iterable of str or None
        What it would have written.
    """
    with terminable():
        try:
            yield
        except KeyboardInterrupt as error:
            what = "terminated" if isinstance(error, Terminated) else "interrupted"
            lost = [f"'{path}'" for path in paths if path not in (None, "-")]
            rest = f"; {' and '.join(lost)} {'is' if len(lost) == 1 else 'are'} not written" if lost else ""
            print(f"diag-dynamics {command}: {what}{rest}.", file=sys.stderr)
            raise


def _raise(*_):
    raise Terminated
