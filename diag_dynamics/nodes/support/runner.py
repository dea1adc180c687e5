# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Start, spin and end nodes. Signals are handled before anything large is imported."""

import faulthandler
import gc
import os
import signal
import sys
import threading
from importlib import import_module

import rclpy
from rclpy.exceptions import NameValidationException, ParameterException
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from rclpy.utilities import remove_ros_args

from diag_dynamics.entries import Parser
from diag_dynamics.exceptions import DiagDynamicsError, InputError
from diag_dynamics.text import shortened

try:  # Jazzy and later: a third of the CPU time per message
    from rclpy.experimental import EventsExecutor as Executor
except ImportError:
    Executor = SingleThreadedExecutor

PERIOD = 0.2
"""Longest time [s] until an idle executor notices a signal."""

SHUTDOWN_TIMEOUT = 4.0
"""Time [s] in which nodes have to leave the graph.

After it the process ends and prints its stacks.
"""


class Stop:
    """SIGINT and SIGTERM end the spinning between two callbacks.

    rclpy's own handlers would shut down the context, by which a controller sends its last command.
    """

    requested = False
    """Whether a signal has arrived; callbacks that wait look at it."""

    def __init__(self):
        self.future = Future()
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self)

    def __call__(self, *_):
        """End the spinning; the handler of both signals."""
        Stop.requested = True
        # The interrupted code may hold the lock of the future, so another thread waits for it.
        threading.Thread(target=self._finish, daemon=True).start()

    def _finish(self):
        if not self.future.done():
            self.future.set_result(None)


def run(make_nodes, args=None):
    """Spin the node, or the list of nodes, that `make_nodes` imports and makes.

    Return the exit status. A signal ends them, or the future `finished` of a node, whose exception
    is status 1. `args` is a command line with the name of the program, by default that of the
    process.
    """
    stop = Stop()
    nodes = []
    status = 0
    try:
        _init(args)
        created = make_nodes()
        nodes = created if isinstance(created, list) else [created]
        del created  # or a lifecycle node stays on the graph
        gc.freeze()  # what was imported stays
        spin(nodes, stop)
    except ExternalShutdownException:
        pass
    except (DiagDynamicsError, NameValidationException, ParameterException) as error:
        print(shortened(f"{type(error).__name__}: {error}"), file=sys.stderr)
        status = 1
    finally:
        _shut_down(nodes)
    return status


def _shut_down(nodes):
    """Take nodes off the graph, within a time: the middleware may wait for itself."""
    faulthandler.dump_traceback_later(SHUTDOWN_TIMEOUT, exit=True)
    cyclic = any(
        hasattr(node, "trigger_shutdown") for node in nodes
    )  # no variable may refer to a node from here on
    while nodes:
        nodes.pop().destroy_node()
    rclpy.try_shutdown()
    if cyclic:  # a lifecycle node refers to itself, and keeps its participant on the graph
        gc.unfreeze()
        gc.collect()
    faulthandler.cancel_dump_traceback_later()


def _init(args):
    try:
        rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as error:  # of arguments that rcl cannot parse
        raise InputError(str(error)) from error


def spin(nodes, stop):
    """Serve callbacks until `stop` is called, a node has finished or the context is shut down.

    Raise the exception of a node that has finished.
    """
    executor = Executor()
    futures = [node.finished for node in nodes if hasattr(node, "finished")]
    for node in nodes:
        executor.add_node(node)
    for future in futures:
        future.add_done_callback(lambda _: stop())
    try:
        # The time-out holds while nothing is to be done; a busy executor runs Python, which calls
        # the signal handler.
        while rclpy.ok() and not stop.future.done():
            executor.spin_until_future_complete(stop.future, timeout_sec=PERIOD)
    finally:
        for node in nodes:
            executor.remove_node(node)
        executor.shutdown()
    for future in futures:
        if future.done():
            future.result()


def main(executable):
    """Run a node by the ROS arguments of the process.

    Leave the process with its exit status.
    """

    def make_node():
        parse_arguments(executable, sys.argv)
        sys.modules["scipy"] = None  # numba would load linear algebra, which no kernel calls
        import_module("numba.np.arraymath")
        del sys.modules["scipy"]
        return node_class(executable)()

    leave(run(make_node, sys.argv))


def node_class(executable):
    """Return the class of a node of this package."""
    module = {"monitor": "monitor.monitor", "controller": "controller.controller"}.get(
        executable, executable
    )
    return getattr(import_module(f"diag_dynamics.nodes.{module}"), f"{executable.capitalize()}Node")


def parse_arguments(executable, args):
    """Print the help, or refuse arguments that are not of ROS."""
    Parser(
        prog=executable,
        usage=f"{executable} [--ros-args -p NAME:=VALUE --params-file FILE -r FROM:=TO "
        "--log-level LEVEL ...]",
        epilog=f"Parameters and their defaults: docs/parameters.md and config/{executable}.yaml. "
        "Topics and services: docs/interfaces.md.",
    ).parse_args(remove_ros_args(args)[1:])


def leave(status):
    """End the process at once.

    A thread that compiles a robot would crash an interpreter that shuts down.
    """
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(status)
