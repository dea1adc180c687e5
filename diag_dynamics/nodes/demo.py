# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The demo: a simulated robot that is pushed, its monitor, the page and `top` in one process."""

import os
import signal
import socket
import sys
from contextlib import suppress
from functools import partial

import numpy as np
from geometry_msgs.msg import WrenchStamped
from rclpy.node import Node
from rclpy.parameter import Parameter
from rich.console import Console

from diag_dynamics.description.catalog import robot_source
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.entries import Parser
from diag_dynamics.exceptions import DiagDynamicsError, InputError
from diag_dynamics.model import end_effector_link, load_urdf
from diag_dynamics.nodes.monitor.monitor import MonitorNode
from diag_dynamics.nodes.simulator import SimulatorNode
from diag_dynamics.nodes.support.descriptions import COMPILED
from diag_dynamics.nodes.support.runner import leave, run
from diag_dynamics.nodes.top import QUIT, Top
from diag_dynamics.nodes.view import ViewNode
from diag_dynamics.numerics.kernel import precompile
from diag_dynamics.numerics.progress import print_message, set_progress_callback
from diag_dynamics.parameters.view import PARAMETERS
from diag_dynamics.simulation import Simulation

NAMESPACE = f"/demo_{os.getpid()}"
"""Separates the topics of the demo from those of a robot, or of another demo."""

PUSH_PERIOD, PUSH_TIME = 6.0, 0.3
"""Time between two pushes, and how long each lasts [s]."""

FORCE, ALARM, CONTACT, DEVIATION = 0.15, 0.03, 0.015, 0.003
"""Force of a push, as a fraction of the robot's weight; external torque of an alarm and of a
contact, and its standard deviation at each joint, as fractions of weight × 1 m."""

RATE, OBSERVER_GAIN, GRAVITY = 250.0, 25.0, 9.81
"""Joint states per second; gain of the monitor's observer [1/s]; acceleration of gravity [m/s²]."""


LEVER = 0.1
"""Distance of a pushed point from the origin of its link [m]."""


def turning_wrench(dynamics, link):
    """Return the wrench on a link that turns its joint, for a force of 1 N; shape (6,).

    It is in the link's axes, about its origin. By the torque in its own joint, a pushed link
    differs from the links before it.
    """
    q = dynamics.model.start
    moved_by = np.flatnonzero(dynamics.jacobian(q, link, frame="link").any(axis=0))
    if not moved_by.size:
        return np.array([0.0, 1.0, 0.0, 0.0, 0.0, 0.0])
    points = LEVER * np.vstack([np.eye(3), -np.eye(3)])
    jacobians = [dynamics.jacobian(q, link, point=point, frame="link") for point in points]
    velocities = [jacobian[:3, moved_by[-1]] for jacobian in jacobians]
    speeds = np.linalg.norm(velocities, axis=1)
    farthest = np.argmax(speeds)
    direction = velocities[farthest] / speeds[farthest]
    return np.concatenate([direction, np.cross(points[farthest], direction)])


class Pusher(Node):
    """Pushes the end effector every few seconds, and the link of a page by its button."""

    def __init__(self, model, link, force):
        super().__init__("pusher")
        self._link = link
        self._force = force
        dynamics = DiagonalDynamics(model)
        self._wrenches = {name: turning_wrench(dynamics, name) for name in model.link_names}
        self._publisher = self.create_publisher(WrenchStamped, "external_wrench", 10)
        # Without an argument: ROS 2 Kilted would pass information on the timer as the link.
        self.create_timer(PUSH_PERIOD, partial(self.push, ""))

    def push(self, link=""):
        """Push beside a link's joint, each time from the other side."""
        message = WrenchStamped()
        message.header.frame_id = link or self._link
        wrench = self._force * self._wrenches[message.header.frame_id]
        force = message.wrench.force
        torque = message.wrench.torque
        force.x, force.y, force.z, torque.x, torque.y, torque.z = wrench.tolist()
        self._force = -self._force
        self._publisher.publish(message)


def find_port(port=PARAMETERS["port"].default):
    """Return this port if it is free, else 0, which stands for any free one."""
    with suppress(OSError), socket.create_server(("127.0.0.1", port)):
        return port
    return 0


def compile_robot(source, massless, loops_file):
    """Load a robot and compile what its nodes call; return the model.

    Messages have the share of the compilation that is done.
    """
    model = load_urdf(source, massless=massless, loops=loops_file or None)
    if model.nv == 0:
        raise InputError(f"robot '{model.name}' has no moving joint; expected at least one.")
    dynamics = DiagonalDynamics(model)
    steps = (
        ("0 to 35 %", partial(dynamics.compile, "evaluate")),
        ("35 to 65 %", partial(dynamics.compile, *COMPILED)),
        ("65 to 90 %", lambda: Simulation(model).advance(steps=0)),
        ("90 to 100 %", partial(precompile, "diag_dynamics.joint_states")),
    )
    for share, compile_part in steps:
        set_progress_callback(partial(print_share, share))
        compile_part()
    set_progress_callback()
    return model


def print_share(share, text):
    """Print what compiles, and which share of all that is."""
    print_message(f"{share}: {text}")


def parse(arguments):
    """Return the options of the command."""
    parser = Parser(prog="demo", description=__doc__)
    parser.add_argument(
        "--robot", default="panda", help="a URDF or xacro file, or a name of diag-dynamics robots"
    )
    parser.add_argument(
        "xacro_args", nargs="*", metavar="NAME:=VALUE", help="arguments of a xacro file"
    )
    parser.add_argument(
        "--loops", metavar="FILE.yaml", default="", help="closed loops of the robot"
    )
    return parser.parse_args(arguments)


def main(args=None):
    """Run the demo until a signal; ``--help`` lists the options."""
    chosen = parse((args or sys.argv)[1:])
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    options = {"massless": "lock", "loops_file": chosen.loops}
    signal.signal(signal.SIGINT, lambda *_: leave(130))  # the compiler catches KeyboardInterrupt
    try:
        source = robot_source(chosen.robot, chosen.xacro_args)
        model = compile_robot(source, **options)
    except DiagDynamicsError as error:
        print(f"{type(error).__name__}: {error}", file=sys.stderr)
        return 1
    link = end_effector_link(model)
    weight = GRAVITY * model.total_mass
    simulator = {
        "robot_description": source,
        "motion": "wave",
        "rate": RATE,
        "wrench_timeout": PUSH_TIME,
    }
    covariance = (DEVIATION * weight) ** 2 * np.eye(model.nv)
    monitor = {
        "external_torque.gain": OBSERVER_GAIN,
        "external_torque.covariance_joints": list(model.dof_names),
        "external_torque.covariance": covariance.ravel().tolist(),
        "external_wrench.frames": [link],
        "collision.threshold": [f"total={ALARM * weight}"],
        "contact.threshold": [f"total={CONTACT * weight}"],
    }

    def make_nodes():
        pusher = Pusher(model, link, FORCE * weight)
        page = {"port": find_port(), "robots": [NAMESPACE]}
        view = ViewNode(pusher.push, parameter_overrides=overrides(page))
        print(f"Open {view.address}", flush=True)
        return [
            SimulatorNode(parameter_overrides=overrides(simulator | options)),
            MonitorNode(parameter_overrides=overrides(monitor | options)),
            pusher,
            view,
            Top(note=f"Page: {view.address}   {QUIT}"),
        ]

    logs = ["--disable-stdout-logs"] if Console().is_interactive else ["--log-level", "WARN"]
    return run(make_nodes, ["demo", "--ros-args", "-r", f"__ns:={NAMESPACE}", *logs])


def overrides(values):
    """Return parameters by their values."""
    return [Parameter(name, value=value) for name, value in values.items()]


if __name__ == "__main__":
    sys.exit(main())
