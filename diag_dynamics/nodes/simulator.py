"""The simulator node: a robot that moves under its own dynamics and publishes what a driver would."""

import math
import sys

import numpy as np
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from diag_dynamics.exceptions import DiagDynamicsError, InputError
from diag_dynamics.model import urdf_text
from diag_dynamics.nodes.diagnostics import ERROR, OK, Diagnostics, Status
from diag_dynamics.nodes.inputs.followers import Followers
from diag_dynamics.nodes.messages import doubles, to_time
from diag_dynamics.nodes.parameters import Spec, declare
from diag_dynamics.nodes.robot import COMPILED, load_robot
from diag_dynamics.nodes.robot import PARAMETERS as ROBOT_PARAMETERS
from diag_dynamics.nodes.runner import main_of
from diag_dynamics.simulation import Simulation, Wave

PARAMETERS = {
    "robot_description": Spec("", "URDF, or the path of one; required.", read_only=True),
    **{
        name: ROBOT_PARAMETERS[name]._replace(read_only=True)
        for name in ("mimic", "massless", "locked_joints", "armature", "gravity")
    },
    "rate": Spec(500.0, "joint_states per second [Hz].", read_only=True, minimum=1.0, maximum=10000.0),
    "step": Spec(0.001, "Integration step [s].", read_only=True, minimum=1e-6, maximum=0.1),
    "motion": Spec(
        "free",
        "free: no effort on the joints; wave: each joint is driven along a sine wave about the middle of its range.",
        read_only=True,
        choices=("free", "wave"),
    ),
}

MOST_BEHIND = 0.1
"""Lag behind real time [s] beyond which the simulation lets time go rather than catch up."""


class SimulatorNode(Node):
    """See the module; parameters are in :data:`PARAMETERS`."""

    def __init__(self, **kwargs):
        super().__init__("diag_dynamics_simulator", **kwargs)
        values = declare(self, PARAMETERS)
        if not values["robot_description"]:
            raise InputError("parameter 'robot_description' is empty: give the simulator a URDF or the path of one.")
        text = urdf_text(values["robot_description"])
        model = load_robot(self, text, values | {"floating_base": False, "payloads": []})
        self._simulation = Simulation(model, step=min(values["step"], 1.0 / values["rate"]))
        self._simulation.dynamics.compile(*COMPILED)
        self._wave = Wave(self._simulation) if values["motion"] == "wave" else None
        self._effort = np.zeros(model.nv)
        self._simulation.advance(steps=0)
        self._followers = Followers(model.dof_names, model.mimics)
        self._names = [*model.dof_names, *self._followers.names]
        self._period = 1.0 / values["rate"]
        self._let_go = 0.0
        self._failure = ""

        once = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._description = self.create_publisher(String, "robot_description", once)
        self._description.publish(String(data=text))
        self._joint_states = self.create_publisher(JointState, "joint_states", 10)
        self._diagnostics = Diagnostics(self, self._report)
        self._start = self.get_clock().now().nanoseconds
        self._timer = self.create_timer(self._period, self._tick)
        self.get_logger().info(
            f"Ready: robot '{model.name}', {model.nv} degrees of freedom, motion '{values['motion']}', "
            f"{values['rate']:g} Hz."
        )

    def _tick(self):
        """Bring the simulation up to now, and publish where it is."""
        if self._failure:
            return
        simulation = self._simulation
        elapsed = (self.get_clock().now().nanoseconds - self._start) * 1e-9 - self._let_go
        behind = elapsed - simulation.time
        if behind > MOST_BEHIND or behind < -self._period:  # too late to catch up, or the clock has jumped back
            steps = math.floor((behind - self._period) / simulation.step_size)  # stamps stay whole steps apart
            self._let_go += steps * simulation.step_size
            behind -= steps * simulation.step_size
        steps = int(behind / simulation.step_size)
        if steps < 1:
            return  # nothing has happened that is not published yet
        try:
            for _ in range(steps):
                if self._wave:
                    self._effort = self._wave.effort()
                simulation.advance(self._effort)
        except DiagDynamicsError as error:
            self._failure = str(error)
            self.get_logger().error(f"The simulation has stopped: {error}")
            return
        self._publish()

    def _publish(self):
        """Where the robot is: its independent joints, then those that follow them, on which no effort acts of their own."""
        simulation = self._simulation
        stamp = self._start + round((simulation.time + self._let_go) * 1e9)
        message = JointState(name=self._names)
        message.header.stamp = to_time(stamp)
        q, qd, followers = simulation.q, simulation.qd, self._followers
        message.position = doubles(np.append(q, followers.positions(q)))
        message.velocity = doubles(np.append(qd, followers.velocities(qd)))
        message.effort = doubles(np.append(self._effort, np.zeros(len(followers.names))))
        self._joint_states.publish(message)

    def _report(self):
        values = {"simulated time [s]": f"{self._simulation.time:.3f}", "time let go [s]": f"{self._let_go:.3f}"}
        if self._failure:
            return [Status("simulation", ERROR, f"stopped: {self._failure}", values)]
        return [Status("simulation", OK, "running", values)]


main = main_of(SimulatorNode)

if __name__ == "__main__":
    sys.exit(main())
