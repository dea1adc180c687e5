# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""How every node of this package starts, spins and ends."""

import faulthandler
import gc
import sys
from contextlib import contextmanager, suppress

import rclpy
from rclpy._rclpy_pybind11 import RCLError, UnknownROSArgsError
from rclpy.exceptions import ParameterException
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from rclpy.utilities import remove_ros_args

from diag_dynamics.exceptions import DiagDynamicsError, InputError
from diag_dynamics.nodes.support.descriptions import working
from diag_dynamics.nodes.support.plain_options import as_ros_arguments
from diag_dynamics.nodes.support.start import deafen, leave, listen, stop
from diag_dynamics.text import plain

try:  # Jazzy and later: a third of the CPU time per message
    from rclpy.experimental import EventsExecutor as Executor
except ImportError:
    Executor = SingleThreadedExecutor

ARGUMENTS_MAKE_NO_SENSE = (RCLError, UnknownROSArgsError)
"""What rclpy raises of arguments, remappings and files of parameters that it cannot read; it has no public name for them."""


LEAVING = 15.0
"""Time [s] in which a node has to leave the graph: the middleware may wait for itself for ever, and no signal is heard any
more. Less than :data:`start.KINDLY`."""


def run(make_node, args=None):
    """Create a node, spin it until shutdown or a signal, and leave without a trace. Returns the exit status.

    SIGINT and SIGTERM end the spinning between two callbacks; rclpy's own handlers would break off the one that is
    running, or take the context away from it. A node that ends by itself has a future `finished`; one that loads much
    after it was made calls `settled`.
    """
    try:
        return _run(make_node, args)
    finally:
        with _deadline():
            let_go()


def _run(make_node, args):
    listen()
    node = None
    try:
        rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
        if stop.asked:
            return 0
        node = make_node()
        node.settled = settle
        settle()
        done = getattr(node, "finished", None) or Future()
        stop.callback = lambda: done.done() or done.set_result(None)
        if not stop.asked:
            spin(node, done)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    except (DiagDynamicsError, ParameterException, *ARGUMENTS_MAKE_NO_SENSE) as error:
        # What it was started with makes no sense: one line says so.
        print(plain(f"{type(error).__name__}: {error}"), file=sys.stderr)
        return 1
    finally:
        deafen()
        with _deadline():
            if node is not None:
                node.destroy_node()
            rclpy.try_shutdown()
        if working():  # a thread that is torn off while it computes may take the process down with another status
            leave(0)
    return 0


@contextmanager
def _deadline():
    """While the middleware is let go of: :data:`LEAVING`, after which the process ends, and says where its threads stood.

    The thread that sees to it needs no lock of Python's, which a publisher that waits for the middleware has.
    """
    faulthandler.dump_traceback_later(LEAVING, exit=True, file=2)
    try:
        yield
    finally:
        faulthandler.cancel_dump_traceback_later()


def settle():
    """Keep the garbage collector from looking again at what has been loaded, which stays.

    Looking through the libraries of a node takes it some 100 ms, in which no message is taken in.
    """
    gc.collect()
    gc.freeze()
    gc.enable()


def let_go():
    """Have a node that is over leave the graph now, while all is there that this takes.

    rclpy's lifecycle nodes refer to themselves, and what has settled no collector looks at: the node's participant would
    live on, threads and all, until the process exits and the middleware is torn down from below it.
    """
    gc.unfreeze()
    gc.collect()


def spin(node, until):
    """Serve the node's callbacks until the future `until` is done or the context is shut down."""
    executor = Executor()
    executor.add_node(node)
    try:
        # EventsExecutor.spin() serves no timers in some releases; waiting for a future does. Its time-out is for a context
        # that was shut down: it holds only where nothing is left to do, so a busy node is ended by the future alone.
        while rclpy.ok() and not until.done():
            executor.spin_until_future_complete(until, timeout_sec=0.2)
    finally:
        with _deadline():
            executor.remove_node(node)
            executor.shutdown()


def main_of(make_node, parser, defaults):
    """Return the main function of an executable.

    `parser` parses its arguments but for those of ROS; `defaults` are those of its parameters, which are options, too.
    """

    def main(args=None):
        program, *given = args or sys.argv
        try:
            arguments = [program, *as_ros_arguments(given, defaults)]
        except InputError as error:
            print(plain(f"{parser.prog}: {error}"), file=sys.stderr)
            return 2
        with suppress(*ARGUMENTS_MAKE_NO_SENSE):  # run says so
            parser.parse_args(remove_ros_args(arguments)[1:])
        return run(make_node, arguments)

    return main
