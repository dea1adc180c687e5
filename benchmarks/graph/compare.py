# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The floor and the monitor take turns: what each costs at 1 kHz, how fast it gets, and what executors make of it."""

import sys
from collections import defaultdict
from typing import NamedTuple

from diag_dynamics.nodes.support.messages import ORDER
from graph.executors import EXECUTORS
from graph.processes import GraphError
from graph.session import TIMED, Burst, Session, Subject, private_domain
from graph.sweep import Search, search

RATE = 1000.0  # Hz
WARM_UP = 1.0  # s
FLOOR, BYTES, MONITOR = "floor", "bytes", "monitor"
QUEUE = 200
"""Joint states that may wait while the highest rate is looked for: else how long the machine stalls decides, not the node."""

PADDING = 8
"""Bytes by which rclpy pads a message that it serializes for others at most."""

SETS = {"all": ORDER, TIMED: (TIMED,)}
"""What is listened to, by the names that tables have for it."""


class Plan(NamedTuple):
    """How much is measured."""

    seconds: float  # of a burst at 1 kHz
    rounds: int
    searches: int  # rounds that look for the highest rate, too
    search: Search
    executor_rounds: int
    executors: tuple[str, ...] = tuple(EXECUTORS)
    warm_up: float = WARM_UP


FULL = Plan(seconds=5.0, rounds=3, searches=2, search=Search(), executor_rounds=1)
SHORT = Plan(
    seconds=0.5,
    rounds=1,
    searches=1,
    search=Search(seconds=0.3, last=1500.0, bisections=0, beyond=0),
    executor_rounds=1,
    executors=("SingleThreadedExecutor",),
    warm_up=0.2,
)


class Found(NamedTuple):
    """All bursts: those at 1 kHz, one a round, those of the searches, and those at 1 kHz under each executor."""

    steady: dict[Subject, list[Burst]]
    searched: dict[Subject, list[Burst]]
    executors: dict[Subject, list[Burst]]
    sizes: dict[str, dict[str, int]]  # bytes of a serialized message of each topic, by node


def measure(plan):
    """Everything, in turns.

    Raises
    ------
    GraphError
        A process ended, or the floor's messages are not of the monitor's size.
    """
    private_domain()
    subjects = [
        Subject(node, topics) for topics in SETS.values() for node in (FLOOR, BYTES, MONITOR)
    ]
    under = [
        Subject(node, SETS["all"], executor=name)
        for name in plan.executors
        for node in (FLOOR, MONITOR)
    ]
    found = Found(defaultdict(list), defaultdict(list), defaultdict(list), defaultdict(dict))
    for k in range(plan.rounds):
        _say(f"measures nodes, round {k + 1} of {plan.rounds}")
        for subject in subjects:
            with Session(subject) as session:
                found.sizes[subject.node] |= session.sizes
                same_sizes(found.sizes)
                session.burst(RATE, plan.warm_up)
                found.steady[subject].append(session.burst(RATE, plan.seconds))
            if k < plan.searches and subject.node != BYTES:
                with Session(subject._replace(queue=QUEUE)) as session:
                    found.searched[subject] += search(session, plan.search)
    for k in range(plan.executor_rounds):
        _say(f"measures executors, round {k + 1} of {plan.executor_rounds}")
        for subject in under:
            with Session(subject) as session:
                session.burst(RATE, plan.warm_up)
                found.executors[subject].append(session.burst(RATE, plan.seconds))
    return found


def same_sizes(sizes):
    """Raise GraphError if a node's messages are not of the floor's size."""
    for node, own in sizes.items():
        for topic, size in own.items():
            expected = sizes[FLOOR].get(topic, size)
            if abs(size - expected) >= PADDING:
                raise GraphError(
                    f"Messages on {topic} of {node} have {size} bytes; expected {expected}."
                )


def _say(what):
    print(f"… {what}", file=sys.stderr, flush=True)
