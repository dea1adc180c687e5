# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The demo: a simulated robot that is pushed, its monitor, the page and `top` in one process."""

import argparse
import math
import os
import socket
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from concurrent.futures import TimeoutError as FutureTimeoutError
from contextlib import suppress

import numpy as np
from geometry_msgs.msg import WrenchStamped
from rclpy.node import Node
from rclpy.parameter import Parameter

from diag_dynamics.description.catalog import robot_source
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import DiagDynamicsError, InputError
from diag_dynamics.model import end_effector_link, load_urdf
from diag_dynamics.nodes.monitor.monitor import MonitorNode
from diag_dynamics.nodes.simulator import SimulatorNode
from diag_dynamics.nodes.support.descriptions import COMPILED
from diag_dynamics.nodes.support.runner import leave, run
from diag_dynamics.nodes.top import QUIT, Top, has_screen
from diag_dynamics.nodes.view import ViewNode
from diag_dynamics.numerics.kernel import precompile
from diag_dynamics.numerics.progress import set_progress_callback
from diag_dynamics.parameters.view import PARAMETERS
from diag_dynamics.simulation import Simulation
from diag_dynamics.text import Progress

NAMESPACE = f"/demo_{os.getpid()}"
"""Separates the topics of the demo from those of a robot, or of another demo."""

PUSH_PERIOD, PUSH_TIME = 6.0, 0.3
"""Time between two pushes, and how long each lasts [s]."""

FORCE, ALARM, CONTACT, DEVIATION = 0.15, 0.03, 0.015, 0.003
"""Force of a push, as a fraction of the robot's weight; external torque of an alarm and of a
contact, and its standard deviation at each joint, as fractions of weight × 1 m."""

RATE, OBSERVER_GAIN, GRAVITY = 250.0, 25.0, 9.81
"""Joint states per second; gain of the monitor's observer [1/s]; acceleration of gravity [m/s²]."""


class Pusher(Node):
    """Pushes the end effector every few seconds, and the link of a page by its button."""

    def __init__(self, link, force):
        super().__init__("pusher")
        self._link, self._force = link, force
        self._wrenches = self.create_publisher(WrenchStamped, "external_wrench", 10)
        self.create_timer(PUSH_PERIOD, self.push)

    def push(self, link=""):
        """Push a link sideways, each time from the other side."""
        message = WrenchStamped()
        message.header.frame_id, message.wrench.force.y = link or self._link, self._force
        self._force = -self._force
        self._wrenches.publish(message)


def find_port(port=PARAMETERS["port"].default):
    """Return this port if it is free, else another one."""
    for candidate in (port, 0):
        with socket.socket() as probe, suppress(OSError):
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind(("127.0.0.1", candidate))
            return probe.getsockname()[1]
    raise InputError("No port of this machine is free for the page.")


def compile_robot(source, options):
    """Load a robot and compile what its nodes call; return the model."""
    robot = {name: value for name, value in options.items() if name != "loops_file"}
    model = load_urdf(source, loops=options["loops_file"] or None, **robot)
    if model.nv == 0:
        raise InputError(f"robot '{model.name}' has no moving joint; expected at least one.")
    DiagonalDynamics(model).compile(*COMPILED)
    Simulation(model).advance(steps=0)
    precompile("diag_dynamics.joint_states")
    return model


def wait_for(future, text):
    """Return the result of a future; a terminal shows a text and the time. Ctrl-C interrupts it."""
    begun = time.monotonic()
    with Progress() as progress:
        if progress.is_shown:
            set_progress_callback(lambda _: None)
        while True:
            with suppress(FutureTimeoutError):
                return future.result(timeout=0.5)
            minutes, seconds = divmod(int(time.monotonic() - begun), 60)
            progress.show(f"{text} … {minutes}:{seconds:02}")


def compile_rest():
    """Start to compile what the demo does not use, with the lowest priority; return the process."""
    command = [
        "nice",
        "-n",
        "19",
        sys.executable,
        "-m",
        "diag_dynamics",
        "compile",
        "--if-needed",
        "--quiet",
        "--jobs",
        "1",
    ]
    # Elsewhere Python would import a checkout that is the current folder.
    where = {"cwd": os.path.dirname(sys.executable)}
    return subprocess.Popen(command, **where, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def parse(arguments):
    """Return the options of the command."""
    parser = argparse.ArgumentParser(prog="demo", description=__doc__)
    parser.add_argument(
        "--robot", default="panda", help="a URDF or xacro file, or a name of diag-dynamics robots"
    )
    parser.add_argument(
        "xacro_args", nargs="*", metavar="NAME:=VALUE", help="arguments of a xacro file"
    )
    parser.add_argument(
        "--massless", choices=("error", "lock"), default="error", help="joints that move no inertia"
    )
    parser.add_argument(
        "--mimic", choices=("embed", "free", "lock"), default="embed", help="mimic joints"
    )
    parser.add_argument(
        "--loops", metavar="FILE.yaml", default="", help="closed loops of the robot"
    )
    parser.add_argument(
        "--compile-rest", action="store_true", help="compile all other kernels meanwhile"
    )
    parser.add_argument(
        "--duration", type=float, default=math.inf, help="time to run [s] (default: until Ctrl-C)"
    )
    chosen = parser.parse_args(arguments)
    if not chosen.duration > 0.0:
        parser.error(f"argument --duration: {chosen.duration} is not a number > 0")
    return chosen


def main(args=None):
    """Run the demo; ``--help`` lists the options."""
    chosen, lines = parse((args or sys.argv)[1:]), not has_screen()
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    options = {"massless": chosen.massless, "mimic": chosen.mimic, "loops_file": chosen.loops}
    try:
        source, port = robot_source(chosen.robot, chosen.xacro_args), find_port()
        loading = ThreadPoolExecutor(1).submit(compile_robot, source, options)
        model = wait_for(loading, f"Load {chosen.robot} and compile its dynamics")
    except DiagDynamicsError as error:
        print(f"{type(error).__name__}: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        leave(130)
    address = f"http://127.0.0.1:{port}/"
    print(f"Open {address}", flush=True)
    nodes = []

    weight = GRAVITY * model.total_mass

    def make_nodes():
        wrenches = {"wrench_axes": "world", "wrench_timeout": PUSH_TIME}
        simulator = {
            "robot_description": source,
            "motion": "wave",
            "rate": RATE,
            **wrenches,
            **options,
        }
        nodes.append(SimulatorNode(parameter_overrides=overrides(simulator)))
        monitor = {
            "external_torque.gain": OBSERVER_GAIN,
            "external_torque.covariance_joints": list(model.dof_names),
            "external_torque.covariance": ((DEVIATION * weight) ** 2 * np.eye(model.nv))
            .ravel()
            .tolist(),
            "external_wrench.frames": [end_effector_link(model)],
            "collision.threshold": [f"total={ALARM * weight}"],
            "contact.threshold": [f"total={CONTACT * weight}"],
            **options,
        }
        nodes.append(MonitorNode(parameter_overrides=overrides(monitor)))
        nodes.append(pusher := Pusher(end_effector_link(model), FORCE * weight))
        view = {"port": port, "robots": [NAMESPACE]}
        nodes.append(ViewNode(pusher.push, parameter_overrides=overrides(view)))
        topics = [f"{NAMESPACE}/diag_dynamics/state"]
        nodes.append(Top(topics, duration=chosen.duration, note=f"Page: {address}   {QUIT}"))
        set_progress_callback(nodes[-1].accept_progress)
        return nodes.copy()

    logs = ["--log-level", "WARN"] if lines else ["--disable-stdout-logs"]
    compiler = compile_rest() if chosen.compile_rest else None
    try:
        status = run(make_nodes, ["demo", "--ros-args", "-r", f"__ns:={NAMESPACE}", *logs])
    finally:
        if compiler:
            compiler.terminate()
    if not status and lines and not nodes[-1].has_states:
        print("No state of the robot arrived.", file=sys.stderr)
        return 1
    return status


def overrides(values):
    """Return parameters by their values."""
    return [Parameter(name, value=value) for name, value in values.items()]


if __name__ == "__main__":
    sys.exit(main())
