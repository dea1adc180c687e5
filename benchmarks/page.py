# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the view costs: CPU-seconds of its process for each second of a page at 50 Hz, and of the monitor beside it.

`python benchmarks/page.py` in the sourced environment takes five minutes and writes benchmarks/results/view.md.
"""

import argparse
import contextlib
import os
import signal
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import NamedTuple

import psutil

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "test" / "support")]

# E402: `streams` is in test/support and found by the line above alone.
from diag_dynamics.description.catalog import find_urdf  # noqa: E402
from streams import FRAME, HEARTBEAT, LAYOUT, Stream, get_json  # noqa: E402

HZ = 50.0
"""Frames per second that a tab asks for."""

START = 180.0
"""Longest time for all to run [s]: the first start compiles."""

LIMITS = "regions: {nobody: {mass: 3.0, stiffness: 20000, force: 60}}\n"
"""By which contact is judged where it is shown: the monitor computes it for itself then."""


class Case(NamedTuple):
    """A robot, states per second, the most that one tab may cost [% of a core], and whether contact is shown."""

    robot: str
    rate: float
    most: float
    contact: bool = False

    @property
    def name(self):
        """In the table."""
        return f"{self.robot}, with contact" if self.contact else self.robot


CASES = (
    Case("panda", 50.0, 6.0),
    Case("panda", 50.0, 6.0, contact=True),
    Case("talos_reduced", 50.0, 9.0),
    Case("talos_reduced", 50.0, 9.0, contact=True),
    Case("panda", 500.0, 10.0),
)

RAW = """
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from diag_dynamics.msg import DiagonalizedState
from diag_dynamics.nodes.support.runner import run

class Listener(Node):
    def __init__(self):
        super().__init__("listener")
        newest = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
        self.create_subscription(DiagonalizedState, "/arm/diag_dynamics/state", lambda raw: None, newest, raw=True)

run(Listener)
"""
"""What does nothing with a state's bytes: the least that a node takes by the usual way."""


class Costs(NamedTuple):
    """Of one case, in % of a core: medians over rounds."""

    idle: float
    one: float
    two: float
    raw: float
    frames: float
    """Frames per second of the one tab."""
    monitor: float
    """The monitor while nobody has a view, and while one tab is open."""
    monitor_watched: float


def started(node, *arguments, **parameters):
    """A node in a process of its own."""
    command = [sys.executable, "-m", "diag_dynamics", node, "--ros-args", *arguments]
    for name, value in parameters.items():
        command += ["-p", f"{name}:={value}"]
    return popen(command)


def popen(command):
    """A process that says nothing here."""
    environment = os.environ | {
        "PYTHONPATH": os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])
    }
    return subprocess.Popen(
        command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )


@contextlib.contextmanager
def ended(*processes):
    """End them at the end."""
    try:
        yield
    finally:
        for process in processes:
            process.send_signal(signal.SIGINT)
        for process in processes:
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(20.0)
            process.kill()


class Tab:
    """A stream that is read as fast as it comes, in a thread."""

    def __init__(self, address, contact):
        self.frames, self._open = 0, True
        with Stream(address, robot="/arm") as first:
            link = first.next(LAYOUT)["links"][-1]
        self._stream = Stream(address, robot="/arm", hz=HZ, link=link, timeout=30.0).__enter__()
        self._stream.next(HEARTBEAT)
        if contact:
            self._stream.next(FRAME, lambda frame: frame["contact_limits_worst"] >= 0.0)
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()

    def _read(self):
        with contextlib.suppress(EOFError, OSError, ValueError):
            while self._open:
                self._stream.next(FRAME)
                self.frames += 1

    def close(self):
        """Leave."""
        self._open = False
        self._thread.join()
        self._stream.socket.close()


def used(process):
    """CPU-seconds that a process has used."""
    times = psutil.Process(process.pid).cpu_times()
    return times.user + times.system


def share(processes, seconds):
    """% of a core that each process takes for so long."""
    before, begin = [used(process) for process in processes], time.monotonic()
    time.sleep(seconds)
    passed = time.monotonic() - begin
    return [
        100.0 * (used(process) - b) / passed for process, b in zip(processes, before, strict=True)
    ]


def eventually(condition):
    """Wait until something holds."""
    end = time.monotonic() + START
    while time.monotonic() < end:
        with contextlib.suppress(OSError):
            if condition():
                return
        time.sleep(0.2)
    sys.exit("The processes do not come up.")


def measure(case, seconds, rounds, folder):
    """One case: idle, one tab and two in turns; then without the view."""
    port, robot, rate = 18490, case.robot, case.rate
    observed = {"external_torque.gain": 25.0}
    if case.contact:
        limits = Path(folder) / "limits.yaml"
        limits.write_text(f"geometry: meshes\n{LIMITS}", encoding="utf-8")
        observed |= {
            "contact_limits.file": limits,
            "robot_description": find_urdf(robot),
        }
    simulator = started(
        "simulator",
        "-r",
        "__ns:=/arm",
        robot_description=find_urdf(robot),
        motion="wave",
        rate=rate,
    )
    monitor = started("monitor", "-r", "__ns:=/arm", **observed)
    view = started("view", port=port)
    address = f"http://127.0.0.1:{port}/"
    raw = popen([sys.executable, "-c", RAW])
    with ended(view, raw, monitor, simulator):
        eventually(lambda: any(one["alive"] for one in get_json(address, "/robots")))
        found = {name: [] for name in Costs._fields}
        for _ in range(rounds):
            idle, raw_share = share([view, raw], seconds)
            tabs = [Tab(address, case.contact)]
            before = tabs[0].frames
            one, watched = share([view, monitor], seconds)
            frames = (tabs[0].frames - before) / seconds
            tabs.append(Tab(address, case.contact))
            (two,) = share([view], seconds)
            for tab in tabs:
                tab.close()
            for name, value in (
                ("idle", idle),
                ("one", one),
                ("two", two),
                ("raw", raw_share),
                ("frames", frames),
            ):
                found[name].append(value)
            found["monitor_watched"].append(watched)
        with ended(view):
            pass
        for _ in range(rounds):
            found["monitor"].extend(share([monitor], seconds))
        return Costs(**{name: statistics.median(values) for name, values in found.items()})


def page(found):
    """Lines of view.md."""
    lines = [
        "# Benchmark of the browser view",
        "",
        "Written by `python benchmarks/page.py`. CPU-seconds of the view's process per second, in % of a core: without a",
        f"tab, with one and with two that take {HZ:g} frames per second with a link's ellipsoid. Beside it a node that",
        "subscribes to the bytes of states and does nothing with them, and the monitor, which observes external torque,",
        "without a view and with one. Whatever else a machine does makes these larger. Where it is too busy for all frames,",
        "the bound is compared with what as many as were asked for would cost. With contact the monitor judges all links by",
        "their meshes against limits, and each frame has the contact of each link.",
        "",
        "| robot | states/s | no tab | one tab | two tabs | frames/s | at most | raw subscription | monitor, watched |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for case, one in found.items():
        verdict = (
            f"{case.most:g} %, {'met' if one.one * HZ / one.frames <= case.most else 'missed'}"
        )
        shares = (
            f"{one.idle:.1f} % | {one.one:.1f} % | {one.two:.1f} % | {one.frames:.1f} | {verdict}"
        )
        monitor = f"{one.raw:.1f} % | {one.monitor:.1f} %, {one.monitor_watched:.1f} %"
        lines.append(f"| {case.name} | {case.rate:g} | {shares} | {monitor} |")
    return [*lines, ""]


def main():
    """Measure, print and write."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument(
        "--seconds", type=float, default=6.0, help="of each measurement (default %(default)s)"
    )
    options.add_argument("--rounds", type=int, default=3)
    options.add_argument(
        "--contact", action="store_true", help="robots with contact, and the same without it, alone"
    )
    options.add_argument("--output", type=Path, default=ROOT / "benchmarks" / "results" / "view.md")
    chosen = options.parse_args()
    os.environ.setdefault("ROS_DOMAIN_ID", "120")  # beyond those of tests
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    wanted = [case for case in CASES if case.rate == CASES[0].rate or not chosen.contact]
    with tempfile.TemporaryDirectory() as folder:
        found = {case: measure(case, chosen.seconds, chosen.rounds, folder) for case in wanted}
    text = "\n".join(page(found))
    print(text)
    chosen.output.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
