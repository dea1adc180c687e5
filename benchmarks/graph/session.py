# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""One node between a robot that feeds it and somebody who listens, for as many bursts of joint states as wanted."""

import contextlib
import json
import os
import time
from typing import NamedTuple

import numpy as np
import psutil

from diag_dynamics.description.catalog import find_urdf
from diag_dynamics.nodes.monitor.outputs import TYPES
from graph import prebuilt
from graph.processes import START, GraphError, Process

TIMED = "kinetic_energy"
"""The topic that latencies are taken from; if it is not among those listened to, the first of them."""

KEPT = 0.97
"""Part of the rate asked for that a feeder has to reach, else it was the limit."""

BUSY = 0.95
"""Part of a core beyond which a process had nothing left, and of all cores beyond which the machine had not."""


RELAYS = {"floor": "Relay", "bytes": "BytesRelay"}
"""Classes of graph.relay by the names of nodes."""


class Subject(NamedTuple):
    """What is measured: a node, and who listens to what."""

    node: str  # "floor", "bytes" or "monitor"
    topics: tuple[str, ...]
    robot: str = "xarm7"
    executor: str = "EventsExecutor"
    queue: int = 5  # joint states that wait for the node, before the oldest is lost

    def process(self):
        """The node, started."""
        if self.node in RELAYS:
            wanted = [
                output for output in prebuilt.outputs(self.robot) if output.topic in self.topics
            ]
            return Process(
                "graph.relay", self.executor, str(self.queue), json.dumps(wanted), RELAYS[self.node]
            )
        parameters = {
            "robot_description": find_urdf(self.robot),
            "qos_overrides./joint_states.subscription.depth": self.queue,
        }
        arguments = [
            word for name, value in parameters.items() for word in ("-p", f"{name}:={value}")
        ]
        return Process(
            "graph.monitor", self.executor, "--ros-args", "--log-level", "warn", *arguments
        )


class Burst(NamedTuple):
    """What one burst of joint states has shown. CPU times are in seconds."""

    asked: float  # rate [Hz]
    sent: int
    seconds: float
    received: int  # messages of the topic that is timed; all that was sent if nobody listens
    latencies: (
        np.ndarray
    )  # from the stamp of a joint state to the receipt of what was made of it [s]
    cpu: float  # of the node
    listener_cpu: float
    late: float  # of the feeder's at worst: how long this machine does not run a process that is due [s]
    machine: float  # part of all cores that was busy, with whatever
    memory: int  # resident bytes of the node

    @property
    def rate(self):
        """Rate that was sent at [Hz]."""
        return self.sent / self.seconds

    @property
    def loss(self):
        """Part of what was sent that nothing came of."""
        return 1.0 - self.received / self.sent

    @property
    def backlog(self):
        """Joint states that waited for the node during the last tenth of the burst, in the median."""
        last = self.latencies[-max(len(self.latencies) // 10, 1) :]
        return float(np.median(last)) * self.rate if len(last) else np.inf

    @property
    def cpu_per_message(self):
        """CPU time of the node for each joint state that something came of [s]."""
        return self.cpu / max(self.received, 1)

    @property
    def share(self):
        """Part of a core that the node took."""
        return self.cpu / self.seconds

    @property
    def kept(self):
        """Whether the feeder kept its rate."""
        return self.rate >= KEPT * self.asked

    @property
    def limit(self):
        """Who had nothing left to give, if messages were lost or not all were sent."""
        signs = {
            "node": self.share > BUSY,
            "listener": self.listener_cpu > BUSY * self.seconds,
            "machine": self.machine > BUSY,
            "feeder": not self.kept,
        }
        return next((who for who, sign in signs.items() if sign), "queue")

    def percentile(self, percent):
        """Of the latencies [s]."""
        return float(np.percentile(self.latencies, percent)) if self.received else np.inf


class Session(contextlib.AbstractContextManager):
    """The three processes of a subject; entered, joint states arrive and all topics flow.

    Attributes
    ----------
    sizes : dict of str to int
        Bytes of a serialized message of each topic.
    """

    def __init__(self, subject):
        self._subject = subject
        self.sizes = {}

    def __enter__(self):
        topics = sorted(self._subject.topics, key=lambda topic: topic != TIMED)
        kinds = [f"{topic}:{TYPES[topic].__name__}" for topic in topics]
        with contextlib.ExitStack() as processes:
            self._node = processes.enter_context(self._subject.process())
            self._listener = (
                processes.enter_context(Process("graph.listener", *kinds)) if topics else None
            )
            self._feeder = processes.enter_context(
                Process("graph.feeder", *prebuilt.joints(self._subject.robot))
            )
            self._await_flow(set(topics))
            self._processes = processes.pop_all()
        return self

    def __exit__(self, *error):
        for process in filter(None, (self._feeder, self._node, self._listener)):
            process.stop()
        self._processes.close()

    def _await_flow(self, topics):
        """Send until something has come on every topic; a first message may be lost while DDS is still matching."""
        deadline, missing = time.monotonic() + START, {"joint_states", *topics}
        while missing:
            self._node.alive()
            if time.monotonic() > deadline:
                raise GraphError(
                    f"{self._subject}: nothing on {', '.join(missing)}:\n{self._node.errors()}"
                )
            if self._feeder.ask("burst", 100.0, 0.1)["matched"]:
                missing.discard("joint_states")
            if topics:
                self.sizes = self._listener.ask("sizes")
                missing -= set(self.sizes)

    def burst(self, rate, seconds):
        """Feed at a rate [Hz] for a while."""
        if self._listener:
            self._listener.ask("begin")
        cpu, everybody = self._node.cpu(), _busy()
        fed = self._feeder.ask("burst", rate, seconds, seconds=seconds)
        machine = _share(everybody, _busy())
        heard = (
            self._listener.ask("end", fed["sent"])
            if self._listener
            else {"latencies": [], "cpu": 0.0}
        )
        cpu = self._node.cpu() - cpu
        self._node.alive()
        return Burst(
            asked=rate,
            sent=fed["sent"],
            seconds=fed["seconds"],
            received=len(heard["latencies"]) if self._listener else fed["sent"],
            latencies=1e-9 * np.array(heard["latencies"]),
            cpu=cpu,
            listener_cpu=heard["cpu"],
            late=fed["late"],
            machine=machine,
            memory=self._node.memory(),
        )


def private_domain():
    """Keep off robots of other people, unless the environment says where to be."""
    os.environ.setdefault("ROS_DOMAIN_ID", "43")
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")


def _busy():
    """Seconds that all cores together were busy, and that have passed for them."""
    times = psutil.cpu_times()
    everything = sum(times[:8])  # guests are part of user and nice
    return everything - times.idle - getattr(times, "iowait", 0.0), everything


def _share(before, after):
    return (after[0] - before[0]) / max(after[1] - before[1], 1e-9)
