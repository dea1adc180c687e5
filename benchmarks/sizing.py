"""What a monitor costs its machine: CPU time per joint state, by robot, rate and what is subscribed to.

``python benchmarks/sizing.py`` in the sourced environment prints the table of docs/operations.md. The monitor, the robot
(a feeder of joint states) and the subscriber are processes of their own; the CPU time is the monitor's alone, over all its
threads, as the kernel counts it.
"""

import argparse
import os
import subprocess
import sys
import time
from statistics import median

import numpy as np
import psutil
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import JointState

import diag_dynamics as dd
from diag_dynamics.example_robots import find_urdf
from diag_dynamics.nodes.outputs import TOPICS

ROBOTS = ("double_pendulum", "ur5_robot", "panda", "talos_reduced")
RATES = (100.0, 1000.0)  # Hz
LISTENED = {"nothing": (), "`state`": ("state",), "all topics": tuple(TOPICS)}
BUSY = 0.9
"""Part of a core beyond which a monitor cannot be said to keep up."""


def feed(robot, rate):
    """Publish joint states at a rate, for ever."""
    model = dd.load_urdf(find_urdf(robot))
    rng = np.random.default_rng(1)
    rclpy.init()
    node = rclpy.create_node("feeder")
    publisher = node.create_publisher(JointState, "joint_states", 10)
    message = JointState(name=list(model.dof_names))
    size = model.nv
    message.position, message.velocity, message.effort = (rng.uniform(-0.3, 0.3, size).tolist() for _ in range(3))
    begin = time.perf_counter()
    k = 0
    while True:
        k += 1
        time.sleep(max(begin + k / rate - time.perf_counter(), 0.0))
        message.header.stamp = node.get_clock().now().to_msg()
        publisher.publish(message)


def listen(topics):
    """Take in what comes on these topics, for ever."""
    rclpy.init()
    node = rclpy.create_node("listener")
    for topic in topics:
        node.create_subscription(TOPICS[topic][0], f"/diag_dynamics/{topic}", lambda _: None, qos_profile_sensor_data)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    executor.spin()


class Counter:
    """Counts the monitor's states by its kernel statistics and by what it publishes."""

    def __init__(self, context, monitor):
        self.count = 0
        self._process = psutil.Process(monitor)
        self._node = rclpy.create_node("counter", context=context)
        self._executor = SingleThreadedExecutor(context=context)
        self._executor.add_node(self._node)
        self._reports = []
        from diagnostic_msgs.msg import DiagnosticArray

        self._node.create_subscription(DiagnosticArray, "/diagnostics", self._take, 10)

    def _take(self, array):
        status = next((s for s in array.status if s.name == "diag_dynamics: joint states"), None)
        if status:
            values = {pair.key: pair.value for pair in status.values}
            times = self._process.cpu_times()
            self._reports.append((int(values.get("published", 0)), times.user + times.system, time.monotonic()))

    def measure(self, seconds):
        """CPU time per state, and states per second, over a while."""
        while len(self._reports) < 3 or self._reports[-1][0] == 0:
            self._executor.spin_once(timeout_sec=1.0)
        del self._reports[:-1]
        while self._reports[-1][2] - self._reports[0][2] < seconds:
            self._executor.spin_once(timeout_sec=1.0)
        (n0, cpu0, t0), (n1, cpu1, t1) = self._reports[0], self._reports[-1]
        return (cpu1 - cpu0) / (n1 - n0), (n1 - n0) / (t1 - t0)

    def stop(self):
        """Leave the graph."""
        self._executor.shutdown()
        self._node.destroy_node()


def measured(context, robot, rate, topics, seconds):
    """CPU time of a monitor per state [s], and the rate that it kept up with [Hz]."""
    own = [sys.executable, __file__]
    monitor = [sys.executable, "-m", "diag_dynamics.nodes.monitor", "--ros-args", "--log-level", "warn"]
    monitor += ["-p", f"robot_description:={find_urdf(robot)}"]
    processes = [
        subprocess.Popen(command)
        for command in (monitor, [*own, "--feed", robot, str(rate)], [*own, "--listen", *topics])
    ]
    counter = Counter(context, processes[0].pid)
    try:
        return counter.measure(seconds)
    finally:
        counter.stop()
        for process in processes:
            process.kill()
            process.wait()


def main():
    """Measure all, in turns, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=5.0)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--feed", nargs=2, help=argparse.SUPPRESS)
    parser.add_argument("--listen", nargs="*", help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    if chosen.feed:
        feed(chosen.feed[0], float(chosen.feed[1]))
    if chosen.listen is not None:
        listen(chosen.listen)
    os.environ.setdefault("ROS_DOMAIN_ID", "43")
    context = rclpy.Context()
    rclpy.init(context=context)
    cases = [(robot, rate, name) for robot in ROBOTS for rate in RATES for name in LISTENED]
    found = {case: [] for case in cases}
    for _ in range(chosen.rounds):
        for robot, rate, name in cases:
            found[robot, rate, name].append(measured(context, robot, rate, LISTENED[name], chosen.seconds))
    print("| robot | dof | rate | " + " | ".join(f"{name} subscribed" for name in LISTENED) + " |")
    print("|---|---|---|" + "---|" * len(LISTENED))
    for robot in ROBOTS:
        nv = dd.load_urdf(find_urdf(robot)).nv
        for rate in RATES:
            cells = []
            for name in LISTENED:
                cost, kept = (median(values) for values in zip(*found[robot, rate, name], strict=True))
                share = cost * kept
                cells.append(
                    f"{1e6 * cost:.0f} µs, {100 * share:.0f} %" + (f" (at {kept:.0f} Hz)" * (kept < BUSY * rate))
                )
            print(f"| {robot} | {nv} | {rate:.0f} Hz | " + " | ".join(cells) + " |", flush=True)
    context.try_shutdown()


if __name__ == "__main__":
    main()
