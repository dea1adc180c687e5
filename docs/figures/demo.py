# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Writes docs/demo.svg: the frame of `top` after 18 seconds of `diag-dynamics demo`.

python docs/figures/demo.py
"""

import io
import os
import signal
import threading
from functools import partial
from pathlib import Path

from rich.console import Console
from rich.live import Live

from diag_dynamics.nodes import demo, top

WIDTH = 100


class RecordedLive(Live):
    """Writes its last frame."""

    def stop(self):
        """Write the frame."""
        console = Console(file=io.StringIO(), force_terminal=True, width=WIDTH, record=True)
        console.print(self.get_renderable())
        path = Path(__file__).parents[1] / "demo.svg"
        console.save_svg(str(path), title="diag-dynamics demo")
        super().stop()


if __name__ == "__main__":
    demo.Console = top.Console = partial(Console, force_interactive=True)
    top.Live = partial(RecordedLive, console=Console(file=io.StringIO(), force_terminal=True))
    threading.Timer(18.0, os.kill, (os.getpid(), signal.SIGTERM)).start()
    demo.main(["demo"])
