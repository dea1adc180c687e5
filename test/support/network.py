# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Two hosts and the wire between them, on one machine: Linux network namespaces, and frames carried by hand.

Each host has interfaces, sockets and a /dev/shm of its own, so whatever goes from one to the other goes over the wire.
All of it hangs on this process: it is gone when that ends, by whatever end.

Run as a script, this file is the process of a `RemoteNode`.
"""

import contextlib
import fcntl
import heapq
import itertools
import os
import pickle
import random
import select
import shutil
import struct
import subprocess
import sys
import threading
import time
from collections import Counter

import numpy as np
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message, serialize_message

from nodes import MANY, OUTPUTS, START, TIMEOUT, Reports, Topic, Truth, nanoseconds
from processes import Process

TUN = "/dev/net/tun"
TUNSETIFF, IFF_TAP, IFF_NO_PI = 0x400454CA, 0x0002, 0x1000  # linux/if_tun.h
UDP = 17

GO_ON, END = b"+", b"-"  # what the thread of a wire is told

PATH = os.environ.get("PATH", os.defpath) + ":/usr/sbin:/sbin"


def _tool(name):
    """Where a program is, also where only root looks for it; None if it is not there."""
    return shutil.which(name, path=PATH)


def unavailable():
    """Why there can be no second host here, or None."""
    missing = [name for name in ("unshare", "nsenter", "setpriv", "mount", "ip") if not _tool(name)]
    if missing:
        return f"no {', '.join(missing)} here (util-linux, iproute2)"
    attempt = subprocess.run(_namespaces("true"), capture_output=True, text=True, env=os.environ | {"PATH": PATH})
    if attempt.returncode:
        return f"no privilege to make network namespaces: {attempt.stderr.strip()}"
    try:
        os.close(_tap()[0])
    except OSError as error:
        return f"no TAP devices: {TUN}: {error.strerror}"
    return None


def _namespaces(command):
    """Return the command that runs one in namespaces of its own, with a /dev/shm of its own."""
    script = f"mount -t tmpfs tmpfs /dev/shm && ip link set lo up && {command}"
    return [_tool("unshare"), "--net", "--mount", "sh", "-c", script]


def _tap():
    """Make a network interface whose frames are read from and written to a file; return the file and the name."""
    file = os.open(TUN, os.O_RDWR | os.O_NONBLOCK)
    try:
        request = fcntl.ioctl(file, TUNSETIFF, struct.pack("16sH22x", b"", IFF_TAP | IFF_NO_PI))
    except OSError:
        os.close(file)
        raise
    return file, request[:16].rstrip(b"\0").decode()


class Host(contextlib.AbstractContextManager):
    """A network namespace with a /dev/shm of its own: Fast DDS would find there the processes of other hosts.

    Parameters
    ----------
    number : int
        1 or 2.
    environment : dict
        Of the processes on it, added to that of this process.
    """

    def __init__(self, number, environment):
        self.environment = os.environ | environment
        # It holds the namespaces while this process lives, whose end closes its standard input.
        self._holder = subprocess.Popen(
            _namespaces("echo made && exec cat"),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env=os.environ | {"PATH": PATH},
        )
        self._number = number
        self.plug = None
        with contextlib.ExitStack() as stack:
            stack.push(self)
            assert self._holder.stdout.readline() == b"made\n"
            self.plug, name = _tap()
            self._connect(name)
            stack.pop_all()

    def _connect(self, name):
        """Put an interface into this host, and give it the address 10.0.0.<number>.

        The hosts know each other's hardware address. Else packets would wait for it, and those made while the wire is cut
        would be sent seconds later.
        """
        subprocess.run([_tool("ip"), "link", "set", "dev", name, "netns", str(self._holder.pid)], check=True)
        for arguments in (
            f"link set dev {name} name wire address {_hardware_address(self._number)}",
            f"address add {_address(self._number)}/24 dev wire",
            "link set dev wire up",
            f"neighbour add {_address(3 - self._number)} lladdr {_hardware_address(3 - self._number)} dev wire",
        ):
            subprocess.run(self.command(_tool("ip"), *arguments.split()), check=True)

    def command(self, *command):
        """Return the command that runs one on this host, and no longer than this process runs."""
        mortal = [_tool("setpriv"), "--pdeathsig=KILL", "--"]
        return [*mortal, _tool("nsenter"), f"--target={self._holder.pid}", "--net", "--mount", "--wd=.", "--", *command]

    def process(self, node, *arguments, **parameters):
        """Start a node of this package on this host; `arguments` are ROS arguments."""
        command = [sys.executable, "-m", f"diag_dynamics.nodes.{node}", "--ros-args", *arguments]
        for name, value in parameters.items():
            command += ["-p", f"{name}:={value}"]
        process = Process(self.command(*command), env=self.environment)
        process.command = command  # by which the report of a failure names it
        return process

    def __exit__(self, *_):
        if self.plug is not None:
            os.close(self.plug)
        self._holder.stdin.close()
        self._holder.stdout.close()
        self._holder.kill()
        self._holder.wait()


def _address(number):
    return f"10.0.0.{number}"


def _hardware_address(number):
    return f"02:00:00:00:00:{number:02x}"


class Wire(contextlib.AbstractContextManager):
    """Carries Ethernet frames between two hosts, both ways, and treats them as it is told.

    `carried`, `lost`, `cut_off` and `overtaken` count the frames with UDP by the host (0 or 1) that sent them: delivered;
    lost by chance; not delivered as the wire was cut; delivered after one that was sent later.
    """

    def __init__(self, first, second, seed=1):
        self.carried, self.lost, self.cut_off, self.overtaken = Counter(), Counter(), Counter(), Counter()
        self._plugs = [first.plug, second.plug]
        self._random = random.Random(seed)
        self._lock = threading.Condition()
        self._whole = True
        self._under_way = []  # heap of (when to deliver, serial number, from which host, frame)
        self._serial = itertools.count()
        self._newest = [-1, -1]  # serial number of what was delivered
        self._loss = self._delay = self._jitter = 0.0
        self._orders = os.pipe()
        self._thread = threading.Thread(target=self._carry, name="wire")
        self._thread.start()

    def treat(self, loss=0.0, delay=0.0, jitter=0.0):
        """Lose frames with this probability, delay each by `delay` to `delay + jitter` [s]: those sent from now on."""
        with self._lock:
            self._take_all()
            self._loss, self._delay, self._jitter = loss, delay, jitter
        os.write(self._orders[1], GO_ON)  # it waits for what was under way before

    def drain(self):
        """Wait until nothing is under way."""
        with self._lock:
            assert self._lock.wait_for(lambda: not self._under_way, TIMEOUT)

    def cut(self):
        """Cut the wire: when this returns nothing arrives any more, be it under way already."""
        with self._lock:
            self._whole = False
            for _, _, source, frame in self._under_way:
                self.cut_off[source] += _is_udp(frame)
            self._under_way.clear()
            self._lock.notify_all()

    def restore(self):
        """Mend the wire: of what was sent before, nothing arrives."""
        with self._lock:
            self._take_all()
            self._whole = True

    def _carry(self):
        while True:
            with self._lock:
                self._deliver()
                wait = self._under_way[0][0] - time.monotonic() if self._under_way else None
            ready, _, _ = select.select([*self._plugs, self._orders[0]], [], [], wait and max(wait, 0.0))
            if self._orders[0] in ready and os.read(self._orders[0], 1) == END:
                return
            with self._lock:
                self._take_all()

    def _take_all(self):
        """Take what the hosts have sent."""
        for source in (0, 1):
            self._take(source)

    def _take(self, source):
        with contextlib.suppress(BlockingIOError):
            while True:
                frame = os.read(self._plugs[source], 65536)
                if not self._whole:
                    self.cut_off[source] += _is_udp(frame)
                elif self._random.random() < self._loss:
                    self.lost[source] += _is_udp(frame)
                else:
                    due = time.monotonic() + self._delay + self._jitter * self._random.random()
                    heapq.heappush(self._under_way, (due, next(self._serial), source, frame))

    def _deliver(self):
        """Hand over what is due."""
        while self._under_way and self._under_way[0][0] <= time.monotonic():
            _, serial, source, frame = heapq.heappop(self._under_way)
            os.write(self._plugs[1 - source], frame)
            self.carried[source] += _is_udp(frame)
            self.overtaken[source] += serial < self._newest[source] and _is_udp(frame)
            self._newest[source] = max(self._newest[source], serial)
        if not self._under_way:
            self._lock.notify_all()

    def __exit__(self, *_):
        os.write(self._orders[1], END)
        self._thread.join()
        for end in self._orders:
            os.close(end)


def _is_udp(frame):
    """Whether an Ethernet frame holds a UDP packet over IPv4, or a fragment of one."""
    return frame[12:14] == b"\x08\x00" and frame[23] == UDP


# --- a node on a host


class RemoteNode(contextlib.AbstractContextManager):
    """A node in a process on a host, that does by pipe what it is told here, and says what it hears.

    Callbacks are called in a thread of this process, which holds `changed` meanwhile. `create_subscription` is that of an
    rclpy node, so that a `Topic` can be made of it.
    """

    def __init__(self, host, changed):
        self._changed = changed
        self._subscriptions, self._answers = [], {}
        self._questions = itertools.count()
        self._process = subprocess.Popen(
            host.command(sys.executable, __file__),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env=host.environment,
        )
        self._reader = threading.Thread(target=self._read, name="remote node")
        self._reader.start()

    def _read(self):
        with contextlib.suppress(EOFError):
            while True:
                number, answer, content = pickle.load(self._process.stdout)
                with self._changed:
                    if answer:
                        self._answers[number] = content
                    else:
                        kind, callback = self._subscriptions[number]
                        callback(deserialize_message(content, kind))
                    self._changed.notify_all()

    def _ask(self, *question):
        """Have something done there, and return what came of it."""
        number = next(self._questions)
        pickle.dump((number, *question), self._process.stdin)
        self._process.stdin.flush()
        with self._changed:
            done = self._changed.wait_for(lambda: number in self._answers or not self._reader.is_alive(), START)
            assert done and number in self._answers, f"the remote node does not answer {question}"
            return self._answers.pop(number)

    def create_subscription(self, kind, name, callback, qos):
        """Subscribe."""
        with self._changed:
            self._subscriptions.append((kind, callback))
        return self._ask("subscribe", len(self._subscriptions) - 1, kind, name, _policies(qos))

    def publisher(self, kind, name, qos=MANY):
        """Return a function that publishes a message, which is on its way when that returns."""
        number = self._ask("advertise", kind, name, _policies(qos))
        return lambda message: self._ask("publish", number, serialize_message(message))

    def count_publishers(self, name):
        """Return how many publishers of a topic the host knows of."""
        return self._ask("count_publishers", name)

    def __exit__(self, *_):
        with contextlib.suppress(BrokenPipeError):
            self._process.stdin.close()
        try:
            self._process.wait(TIMEOUT)
        finally:
            self._process.kill()
            self._process.wait()
            self._reader.join()
            self._process.stdout.close()


def _policies(qos):
    return {name: getattr(qos, name) for name in ("history", "depth", "reliability", "durability")}


def serve():
    """Be the process of a remote node, until its standard input is closed."""
    lock = threading.Lock()
    publishers, subscriptions = [], []

    def say(number, answer, content):
        with lock:
            pickle.dump((number, answer, content), sys.stdout.buffer)
            sys.stdout.buffer.flush()

    def subscribe(number, kind, name, policies):
        hear = lambda content: say(number, False, content)  # noqa: E731 (rclpy looks at its signature)
        subscriptions.append(node.create_subscription(kind, name, hear, QoSProfile(**policies), raw=True))

    def advertise(kind, name, policies):
        publishers.append(node.create_publisher(kind, name, QoSProfile(**policies)))
        return len(publishers) - 1

    def publish(number, content):
        publishers[number].publish(content)

    rclpy.init()
    node = rclpy.create_node("remote")
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    spinning = threading.Thread(target=executor.spin)
    spinning.start()
    actions = {
        "subscribe": subscribe,
        "advertise": advertise,
        "publish": publish,
        "count_publishers": node.count_publishers,
    }
    try:
        with contextlib.suppress(EOFError):
            while True:
                number, action, *arguments = pickle.load(sys.stdin.buffer)
                say(number, True, actions[action](*arguments))
    finally:
        executor.shutdown()
        spinning.join()
        node.destroy_node()
        rclpy.try_shutdown()


# --- all together


class Network(contextlib.AbstractContextManager):
    """A robot's host and a monitor's host, a wire, and a node of the test's on either."""

    def __init__(self, **environment):
        self._changed = threading.Condition()
        with contextlib.ExitStack() as stack:
            self.hosts = [stack.enter_context(Host(number, environment)) for number in (1, 2)]
            self.wire = stack.enter_context(Wire(*self.hosts))
            nodes = [stack.enter_context(RemoteNode(host, self._changed)) for host in self.hosts]
            self.robot_host, self.monitor_host = self.hosts
            self.robot_node, self.monitor_node = nodes
            self._stack = stack.pop_all()

    def __exit__(self, *error):
        self._stack.__exit__(*error)

    def wait_until(self, condition, what, timeout=TIMEOUT):
        """Wait until a condition on what was heard holds, and return its value; `what` is being waited for."""
        value = self.wait(condition, timeout)
        assert value, f"waited {timeout:g} s in vain for {what}"
        return value

    def wait(self, condition, timeout):
        """Wait so long for a condition to hold, and return its value."""
        with self._changed:
            return self._changed.wait_for(condition, timeout)


# --- what a monitor says, wherever it is heard


class Watch:
    """All that a monitor publishes.

    Parameters
    ----------
    node : rclpy.node.Node or RemoteNode
    wait_until : callable
        Waits for a condition, as does that of a `Peer` or a `Network`.
    name : str
        The monitor's.
    """

    def __init__(self, node, wait_until, name):
        self.name, self.wait_until = name, wait_until
        self.topics = {topic: Topic(node, kind, f"{name}/{topic}", MANY) for topic, kind in OUTPUTS.items()}
        self.reports = Reports(node, wait_until, name)

    def wait_for_report(self, condition, what, begin=None, timeout=TIMEOUT):
        """Wait for a report that fulfils a condition, and return it: see :meth:`Reports.wait_for`."""
        return self.reports.wait_for(condition, what, begin, timeout)

    def wait_for_states(self, count, since, inputs, timeout=TIMEOUT):
        """Wait for so many states newer than a stamp whose inputs were heard, too, and for something on every topic."""

        def there():
            newer = sum(stamp > since and inputs.at(stamp) is not None for stamp in self.topics["state"].stamps)
            return newer >= count and all(topic.stamps and topic.stamps[-1] > since for topic in self.topics.values())

        self.wait_until(there, f"states of {self.name}", timeout)

    def check(self, robot, inputs, complete=True):
        """Everything published is what Pinocchio makes of the input with its stamp, and never goes back in time.

        Parameters
        ----------
        robot : Robot
        inputs : dict
            Positions, velocities and efforts, in the robot's order, by stamp.
        complete : bool
            Whether these are all inputs there were, so that no output may have another stamp.

        Returns
        -------
        int
            How many inputs something was published of.
        """
        heard = {name: list(topic.stamps) for name, topic in self.topics.items()}
        for name, stamps in heard.items():
            assert all(a < b for a, b in itertools.pairwise(stamps)), f"{name} goes back in time"
            strange = [stamp for stamp in stamps if stamp not in inputs]
            assert not (complete and strange), f"{name} has stamps that no input has: {strange}"
        compared = sorted(set(inputs).intersection(itertools.chain(*heard.values())))
        for stamp in compared:
            published = {name: topic.at(stamp) for name, topic in self.topics.items() if topic.at(stamp)}
            Truth(robot, *inputs[stamp]).check(published, stamp)
        return len(compared)

    def forget(self):
        """Drop all that was heard so far, but for the last report."""
        for topic in self.topics.values():
            topic.forget()
        del self.reports[:-1]


def values(robot, messages):
    """Return positions, velocities and efforts of JointState messages, in the robot's order, by stamp."""
    found = {}
    for message in messages:
        at = [message.name.index(name) for name in robot.names]
        fields = (np.array(field)[at] for field in (message.position, message.velocity, message.effort))
        found[nanoseconds(message.header.stamp)] = tuple(fields)
    return found


def random_state(robot, rng):
    """Return positions within the limits, velocities and efforts, in the robot's order."""
    limits = {joint.get("name"): joint.find("limit") for joint in robot.oracle.xml.findall("joint")}
    low, high = (
        np.array([float(limits[name].get(side)) if "lower" in limits[name].attrib else turn for name in robot.names])
        for side, turn in (("lower", -np.pi), ("upper", np.pi))
    )
    q = low + (high - low) * rng.random(len(low))
    return q, rng.standard_normal(len(low)), 10 * rng.standard_normal(len(low))


if __name__ == "__main__":
    serve()
