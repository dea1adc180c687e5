# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A robot and its monitor in processes, on one host or on two: Linux network namespaces with a wire between them."""

import contextlib
import ctypes
import fcntl
import heapq
import itertools
import os
import random
import select
import shutil
import signal
import struct
import subprocess
import threading
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from sensor_msgs.msg import JointState

from nodes import MAX_AGE, OUTPUTS, PANDA, START, Reports, Truth, nanoseconds, robot
from processes import node_process

CLONE_NEWNET = 0x40000000
TUN = "/dev/net/tun"
TUNSETIFF, IFF_TAP, IFF_NO_PI = 0x400454CA, 0x0002, 0x1000  # linux/if_tun.h
UDP = 17
OK, WARN, STALE = b"\x00", b"\x01", b"\x03"


def _ip(arguments):
    program = shutil.which("ip", path=f"{os.environ.get('PATH', os.defpath)}:/usr/sbin:/sbin")
    subprocess.run([program or "ip", *arguments.split()], check=True)


class Host(contextlib.AbstractContextManager):
    """A thread in a network namespace of its own, with a network interface whose frames are those of the file `plug`.

    Sockets, threads and processes that :meth:`run` makes belong to that namespace.
    """

    def __init__(self, number):
        """Make host 1 or 2, with the address 10.0.0.<number>; OSError where the process may not."""
        self.plug = None
        self._thread = ThreadPoolExecutor(max_workers=1)
        with contextlib.ExitStack() as stack:
            stack.push(self)
            self.run(self._set_up, number)
            stack.pop_all()

    def run(self, function, *arguments, **named):
        """Call a function on this host, and return its value."""
        return self._thread.submit(function, *arguments, **named).result()

    def _set_up(self, number):
        if ctypes.CDLL(None, use_errno=True).unshare(CLONE_NEWNET):
            raise OSError(ctypes.get_errno(), "no privilege to make a network namespace")
        self.plug = os.open(TUN, os.O_RDWR | os.O_NONBLOCK)
        fcntl.ioctl(self.plug, TUNSETIFF, struct.pack("16sH22x", b"wire", IFF_TAP | IFF_NO_PI))
        _ip("link set lo up")
        _ip(f"link set dev wire address 02:00:00:00:00:0{number}")
        _ip(f"address add 10.0.0.{number}/24 dev wire")
        _ip("link set dev wire up")
        # Without the other's hardware address, packets made while the wire is cut would be sent seconds later.
        _ip(f"neighbour add 10.0.0.{3 - number} lladdr 02:00:00:00:00:0{3 - number} dev wire")

    def __exit__(self, *_):
        if self.plug is not None:
            os.close(self.plug)
        self._thread.shutdown()


class Wire(contextlib.AbstractContextManager):
    """Carries Ethernet frames between two hosts, in a thread.

    `carried`, `lost` and `overtaken` count UDP frames by the host (0 or 1) that sent them: delivered, dropped, and delivered
    after a frame that was sent later.
    """

    def __init__(self, first, second, seed=1):
        self.carried, self.lost, self.overtaken = Counter(), Counter(), Counter()
        self._plugs = [first.plug, second.plug]
        self._random, self._lock = random.Random(seed), threading.Lock()
        self._under_way, self._serial = [], itertools.count()  # heap of (due time, serial number, sender, frame)
        self._newest = [-1, -1]  # serial number of the newest frame delivered
        self._loss = self._jitter = 0.0
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._carry, name="wire")
        self._thread.start()

    def treat(self, loss=0.0, jitter=0.0):
        """Drop frames with a probability, and delay each by a random time of at most `jitter` [s]."""
        with self._lock:
            self._take_all()
            self._loss, self._jitter = loss, jitter

    def cut(self):
        """Cut the wire: nothing arrives from now on, not even what is under way."""
        with self._lock:
            self._take_all()
            self._under_way.clear()
            self._loss = 1.0

    def _carry(self):
        while not self._end.is_set():
            select.select(self._plugs, [], [], 0.001 if self._under_way else 0.05)
            with self._lock:
                self._take_all()
                self._deliver()

    def _take_all(self):
        for sender, plug in enumerate(self._plugs):
            with contextlib.suppress(BlockingIOError):
                while frame := os.read(plug, 65536):
                    self._take(sender, frame)

    def _take(self, sender, frame):
        if self._random.random() < self._loss:
            self.lost[sender] += _is_udp(frame)
        else:
            due = time.monotonic() + self._jitter * self._random.random()
            heapq.heappush(self._under_way, (due, next(self._serial), sender, frame))

    def _deliver(self):
        while self._under_way and self._under_way[0][0] <= time.monotonic():
            _, serial, sender, frame = heapq.heappop(self._under_way)
            os.write(self._plugs[1 - sender], frame)
            self.carried[sender] += _is_udp(frame)
            self.overtaken[sender] += serial < self._newest[sender] and _is_udp(frame)
            self._newest[sender] = max(self._newest[sender], serial)

    def __exit__(self, *_):
        self._end.set()
        self._thread.join()


def _is_udp(frame):
    """Return whether an Ethernet frame holds a UDP packet over IPv4, or a fragment of one."""
    return frame[12:14] == b"\x08\x00" and frame[23] == UDP


class Pair(contextlib.ExitStack):
    """A simulated Panda and its monitor in processes, connected by topics alone, and all that both publish.

    Parameters
    ----------
    peer : LivePeer
        On the monitor's host.
    namespace : str
    start : dict, optional
        Functions that start a node, as `node_process`, for "robot" and "monitor".
    """

    def __init__(self, peer, namespace, start=None):
        super().__init__()
        self.peer, self.robot, self.namespace = peer, robot(PANDA), namespace
        self.name = f"{namespace}/diag_dynamics"
        self.states = peer.topic(JointState, f"{namespace}/joint_states")
        self.topics = {topic: peer.topic(kind, f"{self.name}/{topic}") for topic, kind in OUTPUTS.items()}
        self.reports = Reports(peer.node, peer.wait_until, self.name)
        self._start = start or dict.fromkeys(("robot", "monitor"), node_process)
        self.running = {}

    def start(self, *names):
        """Start "robot" and "monitor" one after the other, each when the one before is ready."""
        here = "-r", f"__ns:={self.namespace}"
        for name in names:
            start = self._start[name]
            if name == "robot":
                motion = {"robot_description": self.robot.path, "motion": "wave", "rate": 50.0}
                process, ready = start("simulator", *here, **motion), "Ready: robot 'panda'"
            else:
                process, ready = start("monitor", *here, max_age=MAX_AGE), "Waiting for a robot"
            self.running[name] = self.enter_context(process)
            process.wait_for_text(ready)

    def kill(self, *names):
        """Kill processes, all at once."""
        for name in names:
            self.running[name].signal(signal.SIGKILL)
        for name in names:
            assert self.running.pop(name).wait() == -signal.SIGKILL

    def forget(self):
        """Drop all messages received so far, but for the last report."""
        for topic in (self.states, *self.topics.values()):
            topic.forget()
        del self.reports[:-1]

    def wait_for_silence(self, since):
        """Wait for two reports of no joint states after a time [ns], the second of a longer silence; check the topics."""

        def silent(report):
            return report.stamp > since and report.level in (WARN, STALE) and "no joint states" in report.message

        reports = [self.reports.wait_for(silent, "silence") for _ in range(2)]
        ages = [float(report.values["age of the last state [s]"]) for report in reports]
        assert ages[1] > ages[0]
        for topic in self.topics.values():
            assert not [stamp for stamp in topic.stamps if since < stamp < reports[1].stamp]

    def wait_for_states(self, since, count=40):
        """Wait until each topic has so many states that are newer than a stamp, and check all that was published."""

        def newer(topic):
            return sum(stamp > since and self.states.at(stamp) is not None for stamp in topic.stamps) >= count

        self.peer.wait_until(lambda: all(map(newer, self.topics.values())), f"states of {self.name}", START)
        self.check()

    def wait_for_recovery(self, since):
        """Wait for right states that are newer than a stamp, and a report without warning."""
        self.wait_for_states(since)
        self.reports.wait_for(lambda report: report.level == OK, "OK")

    def check(self):
        """Compare all that was published with Pinocchio's numbers for the joint state of its stamp; stamps only grow.

        A joint state that did not arrive here may have reached the monitor: its results are not compared.
        """
        inputs = {nanoseconds(message.header.stamp): message for message in self.states.messages}
        for name, topic in self.topics.items():
            assert all(a < b for a, b in itertools.pairwise(topic.stamps)), f"stamps of {name} go back"
        for stamp in inputs.keys() & set(itertools.chain(*(topic.stamps for topic in self.topics.values()))):
            message = inputs[stamp]
            at = [message.name.index(name) for name in self.robot.names]
            state = (np.array(field)[at] for field in (message.position, message.velocity, message.effort))
            published = {name: topic.at(stamp) for name, topic in self.topics.items() if topic.at(stamp)}
            Truth(self.robot, *state).check(published, stamp)
