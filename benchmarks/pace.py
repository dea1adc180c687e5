# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""How well the simulator keeps real time: lateness of its ticks, overruns, and what it costs.

``python benchmarks/pace.py`` in the sourced environment prints the table of results/simulation.md. Each simulator is a
process of its own with a subscriber of its joint states; the figures are its diagnostics. The first line is a timer that
does nothing, because lateness is the machine's as well.
"""

import argparse
import re
import subprocess
import sys
import time
from statistics import median

import psutil
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from graph.session import private_domain
from rclpy.experimental import EventsExecutor
from rclpy.task import Future
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from diag_dynamics import load_urdf
from diag_dynamics.description.catalog import find_urdf

ROBOTS = ("ur5_robot", "panda", "talos_reduced")
RATE = 1000.0
WARM_UP = 5  # reports

IDLE = """
import sys, time, rclpy
from rclpy.experimental import EventsExecutor
from rclpy.task import Future
from diag_dynamics.simulation.pace import Pace
rclpy.init()
node, pace, seconds = rclpy.create_node("idle"), Pace(1.0, 1e-3, 1e-3), float(sys.argv[1])
now = lambda: node.get_clock().now().nanoseconds * 1e-9
done, begin, simulated = Future(), now(), 0.0
def tick():
    global simulated
    simulated += 1e-3 * pace.steps(now(), simulated)
    if now() > begin + seconds and not done.done():
        done.set_result(None)
node.create_timer(1e-3, tick)
pace.resume(now(), 0.0)
executor = EventsExecutor()
executor.add_node(node)
while not done.done():
    executor.spin_until_future_complete(done, timeout_sec=0.2)
report = pace.report()
print(report.mean, report.largest, report.overruns / report.ticks)
"""


def measured(robot, seconds, commanded=False):
    """Reports of a simulator: values by key, one dict a second, and its CPU time per tick [s].

    `commanded`: efforts come at the rate of the joint states, to drives that carry the robot's weight; else it waves.
    """
    parameters = {"robot_description": find_urdf(robot), "rate": RATE}
    parameters |= {"compensates_gravity": True} if commanded else {"motion": "wave"}
    arguments = [word for name, value in parameters.items() for word in ("-p", f"{name}:={value}")]
    process = subprocess.Popen(
        [sys.executable, "-m", "diag_dynamics", "simulator", "--ros-args", *arguments]
    )
    node, reports, done = rclpy.create_node("listener"), [], Future()

    def take(array):
        for status in array.status:
            if status.name.endswith("simulator: pace"):
                reports.append(
                    {pair.key: pair.value for pair in status.values} | {"cpu": sum(cpu()[:2])}
                )
        if len(reports) > WARM_UP + seconds and not done.done():
            done.set_result(None)

    cpu = psutil.Process(process.pid).cpu_times
    node.create_subscription(DiagnosticArray, "/diagnostics", take, 10)
    efforts = Float64MultiArray(data=[0.0] * load_urdf(find_urdf(robot)).nv)
    command = node.create_publisher(Float64MultiArray, "effort_controller/commands", 10)
    answer = (lambda _: command.publish(efforts)) if commanded else (lambda _: None)
    node.create_subscription(JointState, "joint_states", answer, 10, raw=True)
    executor = EventsExecutor()
    executor.add_node(node)
    deadline = time.monotonic() + seconds + 120.0
    while not done.done() and time.monotonic() < deadline:
        executor.spin_until_future_complete(done, timeout_sec=0.2)
    executor.shutdown()
    node.destroy_node()
    process.terminate()
    process.wait()
    return reports[WARM_UP:]


def row(name, reports):
    """A line of the table."""
    ticks = sum(int(report["ticks"]) for report in reports[1:])
    overruns = sum(int(report["overruns"]) for report in reports[1:])
    let_go = sum(float(report["dropped lag [s]"]) for report in reports[1:])
    late = [float(report["lateness, mean [s]"]) for report in reports[1:]]
    largest = [float(report["lateness, maximum [s]"]) for report in reports[1:]]
    cpu = (reports[-1]["cpu"] - reports[0]["cpu"]) / ticks
    cells = (
        f"{1e6 * median(late):.0f} µs",
        f"{1e3 * median(largest):.2f} ms",
        f"{1e3 * max(largest):.1f} ms",
        f"{100 * overruns / ticks:.2f} %",
        f"{let_go:.3f} s",
        f"{1e6 * cpu:.0f} µs",
    )
    return f"| {name} | " + " | ".join(cells) + " |"


def main():
    """Measure, and print the table."""
    parser = argparse.ArgumentParser(description=re.split(r"\n\n", __doc__)[0])
    parser.add_argument("--seconds", type=int, default=30, help="of each simulator")
    seconds = parser.parse_args().seconds
    private_domain()
    rclpy.init()
    begin = time.monotonic()
    print(
        "| robot | late, mean | latest of a second, median | latest of all | overruns | let go | CPU per tick |"
    )
    print("|---|---|---|---|---|---|---|")
    idle = subprocess.run(
        [sys.executable, "-c", IDLE, str(seconds)], capture_output=True, text=True, check=True
    )
    mean, largest, overran = map(float, idle.stdout.split())
    print(
        f"| a timer alone | {1e6 * mean:.0f} µs | — | {1e3 * largest:.1f} ms | {100 * overran:.2f} % | — | — |",
        flush=True,
    )
    for robot in ROBOTS:
        print(row(robot, measured(robot, seconds)), flush=True)
        print(row(f"{robot}, commanded", measured(robot, seconds, commanded=True)), flush=True)
    print(f"\n{time.monotonic() - begin:.0f} s", file=sys.stderr)


if __name__ == "__main__":
    main()
