# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a monitor costs its machine: CPU time per joint state, by robot, rate and what is subscribed to.

``python benchmarks/sizing.py`` in the sourced environment prints the table of results/sizing.md. The monitor, the robot
(a feeder of joint states) and the subscriber are processes of their own; the CPU time is the monitor's alone, over all its
threads, as the kernel counts it.
"""

import argparse
from statistics import median

from graph import prebuilt
from graph.session import Session, Subject, private_domain

from diag_dynamics.nodes.support.messages import ORDER

ROBOTS = ("double_pendulum", "ur5_robot", "panda", "talos_reduced")
RATES = (100.0, 1000.0)  # Hz
LISTENED = {"nothing": (), "`state`": ("state",), "all topics": ORDER}
WARM_UP = 1.0  # s
BUSY = 0.9
"""Part of the rate below which a monitor cannot be said to keep up."""


def measured(subject, seconds):
    """CPU time of a monitor per state [s], and the rate that it kept up with [Hz], for each of the rates."""
    with Session(subject) as session:
        for rate in RATES:
            session.burst(rate, WARM_UP)
            burst = session.burst(rate, seconds)
            yield rate, (burst.cpu_per_message, burst.received / burst.seconds)


def cell(values, rate):
    """Medians of what was measured at a rate, as text."""
    cost, kept = (median(each) for each in zip(*values, strict=True))
    return f"{1e6 * cost:.0f} µs, {100 * cost * kept:.0f} %" + (
        f" (at {kept:.0f} Hz)" * (kept < BUSY * rate)
    )


def main():
    """Measure all, in turns, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=5.0)
    parser.add_argument("--rounds", type=int, default=3)
    chosen = parser.parse_args()
    private_domain()
    found = {(robot, rate, name): [] for robot in ROBOTS for rate in RATES for name in LISTENED}
    for _ in range(chosen.rounds):
        for robot in ROBOTS:
            for name, topics in LISTENED.items():
                for rate, values in measured(Subject("monitor", topics, robot), chosen.seconds):
                    found[robot, rate, name].append(values)
    print("| robot | dof | rate | " + " | ".join(f"{name} subscribed" for name in LISTENED) + " |")
    print("|---|---|---|" + "---|" * len(LISTENED))
    for robot in ROBOTS:
        for rate in RATES:
            cells = [cell(found[robot, rate, name], rate) for name in LISTENED]
            print(
                f"| {robot} | {len(prebuilt.joints(robot))} | {rate:.0f} Hz | {' | '.join(cells)} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
