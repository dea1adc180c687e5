# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A simulator as tests see it: its outputs and its inputs."""

from diag_dynamics.msg import DiagonalizedState
from geometry_msgs.msg import WrenchStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

import diag_dynamics as dd
from nodes import Reports, robot

NODE = "diag_dynamics_simulator"


class Simulator:
    """A simulator, its outputs and its inputs."""

    def __init__(self, peer, namespace, id, waits=True, **parameters):
        """Start it; a context, which begins with its first state if it `waits` for that, and at
        whose end it ends.
        """
        self.peer = peer
        self.robot = robot(id)
        self.name = f"{namespace}/{NODE}"
        self._waits = waits
        self._moves_itself = parameters.get("motion") == "wave"
        self.model = dd.load_urdf(
            self.robot.path, floating_base=parameters.get("floating_base", False)
        )
        self.states = peer.topic(JointState, f"{namespace}/joint_states")
        self.odometry = peer.topic(Odometry, f"{namespace}/odom")
        self.truth = peer.topic(DiagonalizedState, f"{self.name}/ground_truth")
        self.commands = peer.publisher(Float64MultiArray, f"{namespace}/effort_controller/commands")
        self.wrenches = peer.publisher(WrenchStamped, f"{namespace}/external_wrench")
        self.reports = Reports(peer.node, peer.wait_until, self.name)
        self.process = peer.start(
            "simulator", "-r", f"__ns:={namespace}", robot_description=self.robot.path, **parameters
        )

    def __enter__(self):
        if self._waits:
            inputs = (self.wrenches,) if self._moves_itself else (self.wrenches, self.commands)
            ready = [entry.get_subscription_count for entry in inputs]
            self.peer.wait_until(
                lambda: all(count() for count in ready) and self.states.messages, self.name
            )
            self.peer.wait_until(self.truth.subscription.get_publisher_count, "its truth")
            self.peer.become_known(self.name)
        return self

    def __exit__(self, *error):
        self.process.__exit__(*error)

    def wait_for_report(self, condition, what, begin=None):
        """Return the first report for which a condition holds: see :meth:`Reports.wait_for`."""
        return self.reports.wait_for(condition, what, begin)

    def command(self, *efforts):
        """Send efforts."""
        self.commands.publish(Float64MultiArray(data=[float(x) for x in efforts]))

    def push(self, link, *six):
        """Send a wrench on a link."""
        message = WrenchStamped()
        message.header.frame_id = link
        f = message.wrench.force
        n = message.wrench.torque
        f.x, f.y, f.z, n.x, n.y, n.z = map(float, six)
        self.wrenches.publish(message)

    def call(self, kind, service, **fields):
        """Call one of its services."""
        return self.peer.call(kind, f"{self.name}/{service}", kind.Request(**fields))

    def next_state(self):
        """Return the next joint state."""
        count = len(self.states.messages)
        self.peer.wait_until(lambda: len(self.states.messages) > count, "a joint state")
        return self.states.messages[-1]
