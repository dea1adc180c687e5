# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""CPU time of the terminal view `top`, in a terminal of its own, with robots that publish states at 50 Hz."""

import argparse
import fcntl
import os
import pty
import signal
import struct
import subprocess
import sys
import termios
import threading
import time
from pathlib import Path
from typing import NamedTuple

import psutil

ROOT = Path(__file__).resolve().parents[1]
RATE, FRAMES = 50.0, 5.0
"""Of states and of frames [Hz]."""


class Case(NamedTuple):
    """A terminal, and what is on it."""

    joints: int
    robots: int
    width: int
    height: int
    key: str = "1"
    rate: float = RATE


CASES = (
    Case(7, 1, 40, 20),
    Case(7, 1, 80, 24),
    Case(7, 1, 200, 60),
    Case(32, 1, 200, 60, "2"),
    Case(7, 3, 80, 24, "o"),
    Case(7, 1, 80, 24, rate=500.0),
)


class Found(NamedTuple):
    """Of a case: CPU-seconds a second, bytes written a second, and resident memory [MB]."""

    case: Case
    cpu: float
    written: float
    memory: float


def measure(seconds=20.0, cases=CASES):
    """Measure all cases."""
    os.environ.setdefault("ROS_DOMAIN_ID", str(60 + os.getpid() % 40))
    return [_measured(case, seconds) for case in cases]


def _measured(case, seconds):
    feeder = subprocess.Popen(
        [
            sys.executable,
            __file__,
            "--feed",
            *(str(x) for x in (case.joints, case.robots, case.rate)),
        ]
    )
    leader, follower = pty.openpty()
    fcntl.ioctl(follower, termios.TIOCSWINSZ, struct.pack("HHHH", case.height, case.width, 0, 0))
    view = subprocess.Popen(
        [sys.executable, ROOT / "scripts" / "top", "--rate", str(FRAMES)],
        stdin=follower,
        stdout=follower,
        start_new_session=True,
        env=os.environ | {"TERM": "xterm-256color", "LC_ALL": "C.UTF-8"},
    )
    os.close(follower)
    count = [0]

    def read():
        while True:
            try:
                count[0] += len(os.read(leader, 65536))
            except OSError:
                return

    threading.Thread(target=read, daemon=True).start()
    try:
        time.sleep(6.0)  # imports, and the history fills
        os.write(leader, case.key.encode())
        process, begun = psutil.Process(view.pid), time.monotonic()
        times, written = process.cpu_times(), count[0]
        time.sleep(seconds)
        now, span = process.cpu_times(), time.monotonic() - begun
        used = (now.user + now.system - times.user - times.system) / span
        found = Found(case, used, (count[0] - written) / span, process.memory_info().rss / 1e6)
        assert found.written > 100.0, "nothing was drawn"
        return found
    finally:
        for process in (view, feeder):
            process.send_signal(signal.SIGINT)
            process.wait(30)
        os.close(leader)


def table(found):
    """Lines of the table."""
    lines = [
        "| robots | joints | states | terminal | CPU | written | memory |",
        "|---|---|---|---|---|---|---|",
    ]
    for case, cpu, written, memory in found:
        size = f"{case.width} × {case.height}"
        lines.append(
            f"| {case.robots} | {case.joints} | {case.rate:g} Hz | {size} | {100 * cpu:.1f} % | {written / 1e3:.1f} kB/s "
            f"| {memory:.0f} MB |"
        )
    return lines


HEAD = f"""# Benchmark of the terminal view

`make bench ARGS="--only top"`. CPU time of `diag-dynamics top`, {FRAMES:g} frames a second, in parts of a core, with
all of its threads; states and external torques at the rate that is said, from another process. Asked for: no more than
10 % with states at 50 Hz.
"""


def write(found, machine, folder):
    """Write the page."""
    (folder / "top.md").write_text(
        "\n".join([HEAD, *table(found), "", machine, ""]), encoding="utf-8"
    )


def feed(joints, robots, rate):
    """Publish states of robots until a signal comes."""
    import numpy as np
    import rclpy
    from diag_dynamics.msg import DiagonalizedState, ExternalTorque

    rclpy.init()
    node, names = rclpy.create_node("feeder"), [f"joint_{k}" for k in range(joints)]
    publishers = [
        [
            node.create_publisher(kind, f"/robot_{k}/diag_dynamics/{topic}", 10)
            for kind, topic in ((DiagonalizedState, "state"), (ExternalTorque, "external_torque"))
        ]
        for k in range(robots)
    ]
    stop = threading.Event()
    signal.signal(signal.SIGINT, lambda *_: stop.set())
    pace, begun = np.linspace(0.5, 3.0, joints), time.monotonic()
    while not stop.wait(1.0 / rate):
        t = time.monotonic() - begun
        nu, stamp = np.sin(pace * t), node.get_clock().now().to_msg()
        state = DiagonalizedState(
            dof_names=names,
            nu=nu,
            velocity=nu,
            effort=nu,
            effort_valid=True,
            coriolis=np.cos(pace * t),
        )
        state.articulated_inertia, state.gravity, state.epsilon, state.xi = (
            np.ones(joints),
            nu,
            nu,
            nu,
        )
        torque = ExternalTorque(
            dof_names=names,
            valid=True,
            external_torque=nu,
            residual=nu,
            torque_threshold=np.ones(joints),
        )
        for states, torques in publishers:
            for publisher, message in ((torques, torque), (states, state)):
                message.header.stamp = stamp
                publisher.publish(message)
    rclpy.try_shutdown()


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--feed", nargs=3, metavar=("JOINTS", "ROBOTS", "RATE"), required=True)
    given = options.parse_args().feed
    feed(int(given[0]), int(given[1]), float(given[2]))
