# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Writes docs/demo.svg: the frame of `top` after 18 seconds of `diag-dynamics demo`.

python docs/figures/demo.py
"""

import io
from functools import partial
from pathlib import Path

from rich.segment import SegmentLines

from diag_dynamics.nodes import demo, top

WIDTH, HEIGHT = 100, 26


class RecordedTop(top.Top):
    """Writes its frame before it ends."""

    def destroy_node(self):
        """Write the frame."""
        if self._console:
            console = top.make_console(width=WIDTH, height=HEIGHT, record=True)
            frame = self._view.draw(self._shown(), self.time.steady(), WIDTH, HEIGHT)
            console.print(SegmentLines(frame, new_lines=True), end="")
            console.save_svg(
                str(Path(__file__).parents[1] / "demo.svg"), title="diag-dynamics demo"
            )
        return super().destroy_node()


if __name__ == "__main__":
    demo.Top, demo.has_screen = RecordedTop, lambda: True
    top.make_console = partial(top.make_console, file=io.StringIO())
    demo.main(["demo", "--duration", "18"])
