# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A live terminal view of the monitor's kinetic energy; at the end a summary and a picture."""

import argparse
import os
import sys
import time
from pathlib import Path

import numpy as np
from rclpy.clock import Clock, ClockType
from rclpy.exceptions import InvalidTopicNameException
from rclpy.node import Node
from rclpy.task import Future
from rclpy.utilities import remove_ros_args
from rclpy.validate_topic_name import validate_topic_name
from rich.console import Console
from rich.live import Live

from diag_dynamics.msg import DiagonalizedState
from diag_dynamics.nodes.support.graph import NOT_YET_KNOWN, publishers, topics_of
from diag_dynamics.nodes.support.names import NODES
from diag_dynamics.nodes.support.runner import run
from diag_dynamics.text import duration, number, plain
from diag_dynamics.views.energy_history import EnergyHistory
from diag_dynamics.views.terminal import energy_panel

REFRESH = 0.1
"""Seconds between two frames."""

STATE = f"{NODES['monitor']}/state"
"""Where a monitor in the view's own namespace publishes its states."""

KIND = "diag_dynamics/msg/DiagonalizedState"
"""Type of a monitor's states."""

TRUTH = "/ground_truth"
"""End of the name of a simulator's own states, which are shown only to who asks for them."""


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
    """Collects the states of a monitor and shows their kinetic energy.

    Parameters
    ----------
    robot : str
        Title; empty: the topic of the states.
    state : str or None
        Topic of the states; None: :data:`STATE`, or where somebody else on the graph publishes such states.
    duration : float or None
        Seconds to run; None for until Ctrl-C at a terminal and for 10 s elsewhere.
    picture : Path or None
        Where the picture goes.
    watch : callable
        Called with every frame; what it returns, if anything, is why the view has to end.
    """

    def __init__(self, robot="", duration=None, picture=None, watch=lambda: None, state=None, **kwargs):
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
        self._chosen, self._states, self._waiting, self._all_known = state, None, "", True
        self._listen_to(state or STATE)
        self.create_timer(REFRESH, self._frame, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _listen_to(self, topic):
        if self._states:
            self.destroy_subscription(self._states)
        self._states = self.create_subscription(DiagonalizedState, topic, self._take, 100)
        self._shown = self._states.topic_name

    def _look_around(self):
        """Until there is a state: find somebody who publishes some, and tell what is waited for."""
        names, _ = publishers(self, self._states, KIND)
        found = [topic for topic in self._others() if not topic.endswith(TRUTH)]
        if not names and found and not self._chosen:
            self._listen_to(found[0])
        else:
            self._tell()

    def _others(self):
        return [topic for topic in topics_of(self, KIND) if topic != self._states.topic_name]

    def _tell(self):
        """Tell whose states are waited for or shown, and where there are others."""
        names, problems = publishers(self, self._states, KIND)
        self._all_known = NOT_YET_KNOWN not in names
        waiting = f"waiting for states on {self._states.topic_name}, published by {', '.join(names) or 'nobody yet'}"
        lines = [waiting, *problems]
        if others := self._others():
            lines.append(f"such states are on {', '.join(others)} too: --state shows them")
        elif not names:
            lines.append("there are such states on no other topic")
        said = "\n".join(map(plain, lines))
        if self._waiting != said:
            self._waiting = said
            if not self._live:
                self._console.print(self._waiting, highlight=False, markup=False, soft_wrap=True)

    @property
    def _title(self):
        return self._robot or self._shown

    def _take(self, message):
        now = self.get_clock().now().nanoseconds
        if self._history is None:
            self._tell()  # the first state may come before anybody was seen to publish it
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
        if not self._all_known:
            self._tell()  # by name now, if it is known
        if self._history is None:
            self._look_around()
            if self._duration is not None and elapsed > PATIENCE:
                self.failure = self.failure or f"No state arrived within {PATIENCE:.0f} s: {self._waiting}."
        over = self._duration is not None and elapsed > self._duration and self._history is not None
        if (self.failure or over) and not self.finished.done():
            self.finished.set_result(None)
        if self._live:
            size = self._console.size
            history = self._history or EnergyHistory([])
            silent = time.monotonic() - self._received
            panel = energy_panel(self._title, history, size.height, size.width, silent, self._waiting)
            self._live.update(panel, refresh=True)
        elif self._history is not None and elapsed >= self._said + 1:
            self._said = int(elapsed)
            last = self._history.recent(1.0)
            if time.monotonic() - self._received > 1.0:
                self._console.print(f"{self._said:4d} s   no state for {duration(time.monotonic() - self._received)}")
            else:
                self._console.print(
                    f"{self._said:4d} s   K = {number(last[-1, 4:].sum()):>8} J   {len(last) - 1:4d} states/s"
                )

    def destroy_node(self):
        """Leave the live view."""
        if self._live:
            self._live.stop()
        super().destroy_node()

    def conclude(self):
        """Say what there is to remember, and draw it, once the node is over; returns the exit status."""
        if self.failure:
            print(self.failure, file=sys.stderr)
            return 1
        if self._history is not None:
            for line in self._history.summary():
                self._console.print(line, highlight=False, soft_wrap=not self._live, markup=False)
            if self._history.count > 1:
                name = "".join(c if c.isalnum() else "_" for c in self._robot) or "robot"
                path = self._picture or Path(f"kinetic_energy_{name}.png")
                self._history.picture(path, f"{self._title}: kinetic energy of each total joint rate")
                self._console.print(f"picture: {path.resolve()}", highlight=False, soft_wrap=True, markup=False)
        return 0


def main(args=None):
    """Show a running monitor: ``ros2 run diag_dynamics energy_view``."""
    parser = options(argparse.ArgumentParser(prog="energy_view", description=__doc__))
    parser.add_argument("--state", metavar="TOPIC", help=f"its states (default: {STATE}, or those of whoever has some)")
    chosen = checked(parser, parser.parse_args(remove_ros_args(args or sys.argv)[1:]))
    try:
        validate_topic_name(chosen.state or STATE)
    except InvalidTopicNameException as error:
        parser.error(f"argument --state: {error}")
    view = None

    def make_view():
        nonlocal view
        view = EnergyView("", chosen.duration, chosen.picture, state=chosen.state)
        return view

    status = run(make_view, args)
    return status if status or view is None else view.conclude()


if __name__ == "__main__":
    sys.exit(main())
