# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What was measured of the nodes, as Markdown."""

import contextlib
import os
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import NamedTuple

import numpy as np
import rclpy
from report import machine, quartiles
from timing import Ratio, ratio

from graph.compare import BYTES, FLOOR, MONITOR, QUEUE, RATE, SETS
from graph.feeder import BEHIND
from graph.session import BUSY, KEPT, TIMED, Subject
from graph.sweep import BACKLOG, LOSSLESS, TRIES, highest

RELAY = Path(__file__).with_name("relay.py")

KHZ, LOST, FULL = f"{RATE / 1000:g}", f"{100 * LOSSLESS:g}", f"{100 * BUSY:g}"

CPU, P50, P99, HIGHEST = (
    "CPU time per joint state",
    "median latency",
    "p99 latency",
    "highest lossless rate",
)

TARGETS = {
    "all": {CPU: ("≤", 0.85), P50: ("≤", 1.0), P99: ("≤", 1.0), HIGHEST: ("≥", 1.3)},
    TIMED: {CPU: ("≤", 0.6), P50: ("≤", 1.0), P99: ("≤", 1.0), HIGHEST: ("≥", 1.3)},
}


class Line(NamedTuple):
    """One quantity of a monitor as a multiple of the floor's, and its target."""

    quantity: str
    topics: str
    relation: str
    target: float
    ratio: Ratio
    limit: str = ""  # who had nothing left at the next higher rate

    @property
    def met(self):
        """Whether the target is."""
        value = self.ratio.median
        return value <= self.target if self.relation == "≤" else value >= self.target


def lines(found):
    """Every target."""
    judged = []
    for name, topics in SETS.items():
        ours, floor = Subject(MONITOR, topics), Subject(FLOOR, topics)
        ratios = _ratios(found, ours, floor)
        limits = {HIGHEST: highest(found.searched[ours])[1]}
        targets = TARGETS[name].items()
        judged += [
            Line(what, name, *target, ratios[what], limits.get(what, ""))
            for what, target in targets
        ]
    return judged


def summary(found):
    """The table of targets."""
    rows = ["| measured | topics | target | × the floor's | |", "|---|---|---|---|---|"]
    for line in lines(found):
        shown = f"{line.ratio.median:.2f}" if line.quantity == HIGHEST else quartiles(line.ratio)
        target, verdict = f"{line.relation} {line.target:g}", "met" if line.met else "missed"
        if line.limit and line.limit != "node":  # then it is a bound from below
            shown, verdict = (
                f"at least {shown}",
                "met" if line.met else f"not shown: {line.limit} was the limit",
            )
        rows.append(f"| {line.quantity} | {line.topics} | {target} | {shown} | {verdict} |")
    return "\n".join(rows) + "\n"


def page(found):
    """The whole report."""
    return f"""\
# Benchmark of nodes

{summary(found)}
The monitor of a 7-dof arm (xarm7) as a multiple of the *floor*: a node that receives the same joint states and publishes
messages of the same types and sizes at the same rates and QoS, but computes nothing ([below](#the-floor)). What it costs is
what ROS costs in Python where messages are Python objects. *Topics* are what is listened to: nobody else's are made. CPU
time and latencies are those at {KHZ} kHz: medians over rounds in which all nodes take turns, and quartiles in brackets.

![Latency at 1 kHz: part of the messages that are later](nodes_latency.png)

![Loss and CPU time against the rate](nodes_rates.png)

## Each node

{_nodes(found)}
* *Bytes copied* is a node that receives and publishes bytes, of which it writes the stamp alone: no node in rclpy takes less.
* *CPU*: user and system time of all threads of the node's process, for each joint state that something came of.
* *Latency*: from just before a joint state is published, which is its stamp, to the receipt of the `kinetic_energy` made of
  it, which all nodes publish first. p50 and p99 are medians over rounds; p99.9 and max are of all rounds together. *Late* is
  how late the feeder itself was woken up at worst: so much of max is the machine's.
* *Highest lossless*: the highest rate at which no more than {LOST} % of what was sent was lost, and no more than {BACKLOG}
  joint states waited at the end, in one of up to {TRIES} tries each time. *Limit* is who had nothing left at the next rate:
  the node or the listener if it took more than {FULL} % of a core; the machine if {FULL} % of all cores were busy; the feeder
  if it reached less than {100 * KEPT:g} % of the rate; else the node's queue, which filled while nobody was short of anything
  in the mean. There {QUEUE} joint states may wait (5 at 1 kHz, the monitor's default): with few, how long the machine stalls
  decides.

Bytes of the messages, which are the same from all nodes: {_sizes(found)}.

## Executors

At {KHZ} kHz, all topics listened to.

{_executors(found)}
## How it is measured

Three processes: a feeder that publishes serialized joint states of which only the stamp is overwritten; the node; a listener
that times serialized messages by their stamps, and subscribes to the other topics by a node that nobody spins, so that
they are delivered without keeping it busy. What is measured begins when something has come on every topic, and after a
while that does not count. A feeder that was held up leaves out what it could not send, but for {BEHIND} messages.

## The floor

`benchmarks/graph/relay.py`, all of it:

```python
{RELAY.read_text(encoding="utf-8")}```

## Machine

{machine(("numpy", "numba"), extra=_ros())}"""


def _ratios(found, ours, floor):
    def each(subject, value):
        return [value(burst) for burst in found.steady[subject]]

    values = {
        CPU: lambda burst: burst.cpu_per_message,
        P50: lambda burst: burst.percentile(50),
        P99: lambda burst: burst.percentile(99),
    }
    ratios = {what: ratio(each(ours, value), each(floor, value)) for what, value in values.items()}
    most = highest(found.searched[ours])[0] / max(highest(found.searched[floor])[0], 1e-9)
    return ratios | {HIGHEST: Ratio(most, most, most)}


def _name(subject):
    return {FLOOR: "the floor", BYTES: "bytes copied", MONITOR: "the monitor"}[subject.node]


def _nodes(found):
    head = "CPU | p50 | p99 | p99.9 | max | late | memory | lost | highest lossless | limit"
    rows = [f"| topics | node | {head} |", "|---|---|" + "---|" * len(head.split("|"))]
    for subject, bursts in found.steady.items():
        name = next(name for name, topics in SETS.items() if topics == subject.topics)
        latencies = np.concatenate([burst.latencies for burst in bursts])
        searched = found.searched.get(subject)
        rate, limit = highest(searched) if searched else (np.nan, "")
        cells = [
            *_at_rate(bursts)[:3],
            *(_milliseconds(value) for value in (np.percentile(latencies, 99.9), latencies.max())),
            _milliseconds(max(burst.late for burst in bursts)),
            *_at_rate(bursts)[3:],
            f"{rate:.0f} Hz" if searched else "",
            limit,
        ]
        rows.append(f"| {name} | {_name(subject)} | {' | '.join(cells)} |")
    return "\n".join(rows) + "\n"


def _executors(found):
    rows = [
        "| executor | node | CPU | p50 | p99 | memory | lost |",
        "|---|---|---|---|---|---|---|",
    ]
    for subject, bursts in found.executors.items():
        rows.append(f"| {subject.executor} | {_name(subject)} | {' | '.join(_at_rate(bursts))} |")
    return "\n".join(rows) + "\n"


def _at_rate(bursts):
    """CPU, p50, p99, memory and loss of bursts at the same rate."""
    cpu = np.median([burst.cpu_per_message for burst in bursts])
    percentiles = [
        np.median([burst.percentile(percent) for burst in bursts]) for percent in (50, 99)
    ]
    lost = 1.0 - sum(burst.received for burst in bursts) / sum(burst.sent for burst in bursts)
    memory = max(burst.memory for burst in bursts)
    return [
        f"{1e6 * cpu:.0f} µs",
        *map(_milliseconds, percentiles),
        f"{memory / 1e6:.0f} MB",
        f"{100 * lost:.2f} %",
    ]


def _milliseconds(seconds):
    return f"{1e3 * seconds:.2f} ms"


def _sizes(found):
    return ", ".join(f"{topic} {size}" for topic, size in found.sizes[FLOOR].items())


def _ros():
    """The ROS 2 and its middleware."""
    parts = [f"ROS 2 {os.environ.get('ROS_DISTRO', '')}".strip(), f"rclpy {version('rclpy')}"]
    parts.append(rclpy.get_rmw_implementation_identifier())
    with contextlib.suppress(PackageNotFoundError):  # not from PyPI
        parts.append(f"Fast DDS {version('ros-fastrtps')}")
    return ", ".join(parts)
