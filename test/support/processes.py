# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Processes under test whose output is kept, and a node that talks by DDS to nodes in such
processes.
"""

import contextlib
import fcntl
import os
import random
import signal
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import ClassVar

import psutil
import rclpy
from rcl_interfaces.srv import GetParameterTypes
from rclpy.executors import SingleThreadedExecutor

from limits import HANG
from nodes import Peer


class Process(contextlib.AbstractContextManager):
    """A process whose output is kept; a context at whose end it has to end by SIGINT with status
    0.
    """

    started: ClassVar[list["Process"]] = []  # in this test file, for the report of a failure

    def __init__(self, command, **options):
        """Start it, in a session of its own: a Ctrl-C at the test run does not reach it."""
        self.command = [str(part) for part in command]
        options = {
            "stdin": subprocess.DEVNULL,
            "stdout": subprocess.PIPE,
            "stderr": subprocess.STDOUT,
        } | options
        options["env"] = (options.get("env") or os.environ) | {"PYTHONFAULTHANDLER": "1"}
        self.popen = subprocess.Popen(self.command, start_new_session=True, **options)
        self._said = b""
        self._changed = threading.Condition(threading.RLock())
        self._reader = threading.Thread(target=self._read, daemon=True)
        if self.popen.stdout:
            self.listen(self.popen.stdout.fileno())
        Process.started.append(self)

    def listen(self, descriptor):
        """Keep what comes out of a file descriptor."""
        self._descriptor = descriptor
        self._reader.start()

    def _read(self):
        chunk = b"-"
        while chunk:
            try:
                chunk = os.read(self._descriptor, 65536)
            except OSError:  # the other end of a terminal is closed
                chunk = b""
            with self._changed:
                self._said += chunk
                self._changed.notify_all()
        with self._changed:
            self._descriptor = None
            self._changed.notify_all()

    @classmethod
    def report(cls):
        """Return the output of the last processes as sections of a report."""
        return [(f"output of {process}", process.tail()) for process in cls.started[-4:]]

    def __str__(self):
        return (
            " ".join(part.rsplit("/", 1)[-1] for part in self.command[1:4])
            + f", pid {self.popen.pid}"
        )

    @property
    def output(self):
        """All it has said until now."""
        with self._changed:
            return self._said.decode(errors="replace")

    def tail(self, lines=100):
        """Return the last lines of the output."""
        return "".join(self.output.splitlines(keepends=True)[-lines:]) or "(nothing)"

    def wait_for(self, condition, what, timeout=HANG):
        """Wait until a condition on the output holds."""
        with self._changed:
            self._changed.wait_for(
                lambda: self._descriptor is None or condition(self.output), timeout
            )
        if not condition(self.output):
            self.dump_stacks()
            raise AssertionError(f"{self}: waited in vain for {what}")

    def wait_for_text(self, text):
        """Wait until this has been said."""
        self.wait_for(lambda output: text in output, repr(text))

    def children(self):
        """Return the processes that it has started."""
        return psutil.Process(self.popen.pid).children(recursive=True)

    def alive(self):
        """Return whether it still runs."""
        return self.popen.poll() is None

    def signal(self, number):
        """Send it a signal."""
        self.popen.send_signal(number)

    def wait(self, timeout=HANG):
        """Wait for its end, and return its status; where it does not end, it prints its stacks."""
        try:
            status = self.popen.wait(timeout)
        except subprocess.TimeoutExpired:
            self.dump_stacks()
            raise
        self._reader.join(timeout)
        return status

    def dump_stacks(self):
        """End it and its children by a signal at which Python prints the stacks of all threads, one
        after the other.
        """
        if not self.alive():
            return
        for process in (*self.children(), psutil.Process(self.popen.pid)):
            with contextlib.suppress(psutil.Error):
                process.send_signal(signal.SIGABRT)
                process.wait(5.0)

    def stop(self, *signals, timeout=HANG):
        """End it by signals, SIGINT if none is given; it must end with status 0."""
        for number in signals or (signal.SIGINT,):
            self.signal(number)
        status = self.wait(timeout)
        assert status == 0, f"{self} ended with status {status}"
        assert "Traceback" not in self.output

    def __exit__(self, kind, error, traceback):
        try:
            if self.popen.poll() is None and kind is None:
                self.stop()
            elif self.popen.poll() is None and issubclass(kind, Exception):
                self.dump_stacks()
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self.popen.pid, signal.SIGKILL)
            self.popen.wait()


def node_process(node, *arguments, **parameters):
    """Start a node of this package; `arguments` are ROS arguments."""
    command = [sys.executable, "-m", "diag_dynamics", node, "--ros-args", *arguments]
    for name, value in parameters.items():
        command += ["-p", f"{name}:={value}"]
    return Process(command)


@contextlib.contextmanager
def locked_domain():
    """Return a ROS domain by locking a file that stands for it. The lock goes with the process, by
    whatever end.
    """
    for domain in random.SystemRandom().sample(range(1, 102), 101):
        try:
            lock = os.open(
                Path(tempfile.gettempdir(), f"diag_dynamics_ros_domain_{domain}"),
                os.O_RDWR | os.O_CREAT,
                0o666,
            )
        except PermissionError:  # another user's
            continue
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            yield domain
            return
        except BlockingIOError:
            continue
        finally:
            os.close(lock)
    raise RuntimeError("all ROS domains from 1 to 101 are taken by other test runs")


class LivePeer(Peer):
    """A node in the test's process that talks by DDS to nodes in processes of their own."""

    def __init__(self, domain, name="test"):
        """Join a ROS domain."""
        self.context = rclpy.Context()
        rclpy.init(context=self.context, domain_id=domain)
        self.node = rclpy.create_node(name, context=self.context)
        self._executor = SingleThreadedExecutor(context=self.context)
        self._executor.add_node(self.node)
        self.clients = {}

    def __exit__(self, *_):
        self._executor.shutdown()
        self.node.destroy_node()
        self.context.try_shutdown()

    def start(self, name, *arguments, **parameters):
        """Start a node of this package in a process of its own; `arguments` are ROS arguments."""
        return node_process(name, *arguments, **parameters)

    def extra_node(self, name, namespace):
        """Make another node, whose callbacks are served likewise."""
        node = rclpy.create_node(name, namespace=namespace, context=self.context)
        self._executor.add_node(node)
        return node

    def drop_node(self, node):
        """Have it leave the graph."""
        self._executor.remove_node(node)
        node.destroy_node()

    def pass_time(self, seconds):
        """Do nothing: time goes by itself."""

    def wait_until(self, condition, what, timeout=HANG):
        """Serve callbacks until a condition holds, and return its value; `what` is being waited
        for.
        """
        deadline = time.monotonic() + timeout
        while not (value := condition()):
            assert time.monotonic() < deadline, f"waited {timeout:g} s in vain for {what}"
            self._executor.spin_once(timeout_sec=0.1)
        return value

    def become_known(self, node):
        """Wait until a node knows of all clients made here so far.

        A service may be known to its client before the service knows the client, and then its
        response is thrown away after 100 ms. Clients become known in the order in which they were
        made, so that a response to one made now, asked for until it comes, tells that those before
        it are known.
        """
        client = self.node.create_client(GetParameterTypes, f"{node}/get_parameter_types")
        try:
            self.wait_until(client.service_is_ready, f"parameters of {node}")
            deadline = time.monotonic() + HANG  # it may be compiling yet
            while time.monotonic() < deadline:
                future = client.call_async(GetParameterTypes.Request())
                with contextlib.suppress(AssertionError):
                    self.wait_until(future.done, f"a response of {node}", timeout=1.0)
                    return
            raise AssertionError(f"{node} answers nothing")
        finally:
            self.node.destroy_client(client)
