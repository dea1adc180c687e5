"""A live terminal view of the monitor's kinetic energy; at the end a summary and a picture."""

import argparse
import os
import sys
import time
from pathlib import Path

import numpy as np
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.task import Future
from rclpy.utilities import remove_ros_args
from rich.console import Console
from rich.live import Live

from diag_dynamics.history import EnergyHistory
from diag_dynamics.msg import DiagonalizedState
from diag_dynamics.nodes.runner import run
from diag_dynamics.terminal import energy_panel

REFRESH = 0.1
"""Seconds between two frames."""


def options(parser):
    """Add the view's options to a parser."""
    parser.add_argument("--duration", type=float, help="end after so many seconds (10 if not at a terminal)")
    parser.add_argument(
        "--picture", type=Path, help="file for the energies over time (default: kinetic_energy_<robot>.png)"
    )
    return parser


def checked(parser, chosen):
    """Refuse a duration or a picture that could only fail at the end."""
    if chosen.duration is not None and not 0.0 < chosen.duration < float("inf"):
        parser.error(f"argument --duration: {chosen.duration} is not a number > 0")
    folder = (chosen.picture or Path("here")).absolute().parent
    if not os.access(folder, os.W_OK):
        parser.error(f"argument --picture: the folder {folder} cannot be written")
    if chosen.picture and chosen.picture.suffix not in (".png", ".svg", ".pdf", ".jpg"):
        parser.error(f"argument --picture: '{chosen.picture}' is no .png, .svg, .pdf or .jpg")
    return chosen


PATIENCE = 60.0
"""Seconds to wait for the first state where nobody watches who could press Ctrl-C."""


class EnergyView(Node):
    """Collects ``diag_dynamics/state`` and shows it.

    Parameters
    ----------
    robot : str
        Title.
    duration : float or None
        Seconds to run; None for until Ctrl-C at a terminal and for 10 s elsewhere.
    picture : Path or None
        Where the picture goes.
    watch : callable
        Called with every frame; what it returns, if anything, is why the view has to end.
    """

    def __init__(self, robot="", duration=None, picture=None, watch=lambda: None, **kwargs):
        super().__init__("energy_view", **kwargs)
        self.finished = Future()
        self.failure = None
        self._console = Console()
        self._robot = robot
        self._watch = watch
        self._picture = picture
        live = self._console.is_terminal
        self._duration = duration if duration is not None or live else 10.0
        self._history = None
        self._begun, self._said, self._received = time.monotonic(), 0, time.monotonic()
        self._live = Live(console=self._console, auto_refresh=False) if live else None
        if self._live:
            self._live.start()
        self.create_subscription(DiagonalizedState, "diag_dynamics/state", self._take, 100)
        self.create_timer(REFRESH, self._frame, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _take(self, message):
        now = self.get_clock().now().nanoseconds
        if self._history is None or self._history.names != list(message.dof_names):
            self._history = EnergyHistory(message.dof_names)
            self._begun = time.monotonic()
        self._received = time.monotonic()
        stamp = message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec
        nu, coriolis = np.array(message.nu), np.array(message.coriolis)
        size = np.linalg.norm(nu) * np.linalg.norm(coriolis)
        work_rate = abs(nu @ coriolis) / size if size > 0.0 else 0.0
        power = message.power if message.effort_valid else np.nan
        self._history.add(stamp * 1e-9, 0.5 * nu * nu, power, work_rate, (now - stamp) * 1e-9)

    def _frame(self):
        self.failure = self._watch()
        elapsed = time.monotonic() - self._begun
        if self._duration is not None and self._history is None and elapsed > PATIENCE:
            self.failure = self.failure or f"No state arrived within {PATIENCE:.0f} s."
        over = self._duration is not None and elapsed > self._duration and self._history is not None
        if (self.failure or over) and not self.finished.done():
            self.finished.set_result(None)
        if self._live:
            size = self._console.size
            history = self._history or EnergyHistory([])
            silent = time.monotonic() - self._received
            self._live.update(energy_panel(self._robot, history, size.height, size.width, silent), refresh=True)
        elif self._history is not None and elapsed >= self._said + 1:
            self._said = int(elapsed)
            last = self._history.recent(1.0)
            if time.monotonic() - self._received > 1.0:
                self._console.print(f"{self._said:4d} s   no state for {time.monotonic() - self._received:.0f} s")
            else:
                self._console.print(
                    f"{self._said:4d} s   K = {last[-1, 4:].sum():8.4f} J   {len(last) - 1:4d} states/s"
                )

    def destroy_node(self):
        """Leave the live view, and say what there is to remember."""
        if self._live:
            self._live.stop()
        if self._history is not None and not self.failure:
            for line in self._history.summary():
                self._console.print(line, highlight=False, soft_wrap=True)
            if self._history.count > 1:
                name = "".join(c if c.isalnum() else "_" for c in self._robot) or "robot"
                path = self._picture or Path(f"kinetic_energy_{name}.png")
                self._history.picture(path, f"{self._robot}: kinetic energy of each total joint rate")
                self._console.print(f"picture: {path.resolve()}", highlight=False, soft_wrap=True)
        super().destroy_node()


def main(args=None):
    """Show a running monitor: ``ros2 run diag_dynamics energy_view``."""
    parser = options(argparse.ArgumentParser(prog="energy_view", description=__doc__))
    chosen = checked(parser, parser.parse_args(remove_ros_args(args or sys.argv)[1:]))
    return run(lambda: EnergyView("robot", chosen.duration, chosen.picture), args)


if __name__ == "__main__":
    sys.exit(main())
