# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Interface of watches of the monitor's states; watches.WATCHES lists them."""

from typing import Any, NamedTuple, Protocol

from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.joint_states.robot_joints import RobotState
from diag_dynamics.nodes.monitor.outputs import Outputs
from diag_dynamics.nodes.support.statuses import Status
from diag_dynamics.parameters.monitor import Settings
from diag_dynamics.results import Evaluation


class Moment(NamedTuple):
    """A state of the robot, its evaluation, and the steady time of its reception [s]."""

    evaluation: Evaluation
    state: RobotState
    received: float


class Watch(Protocol):
    """Observe the states of a MonitoredRobot: raise alarms, publish results and report statuses.

    A watch without its parameters accepts states and reports nothing. Methods that a watch does not
    need do nothing.
    """

    def __init__(self, robot: Any, node: Any) -> None:
        self._robot = robot
        self._node = node

    def configure(self, dynamics: DiagonalDynamics, settings: Settings) -> None:
        """Use a model and settings; raise InputError and change nothing if they do not fit."""

    def accept(self, moment: Moment) -> list[Status]:
        """Observe a state; return the statuses that cannot wait for the next report."""
        return []

    def publish(self, moment: Moment, outputs: Outputs) -> None:
        """Publish the topics of this watch about the accepted state."""

    def forget(self) -> None:
        """Restart at the next state, for example after a jump of time."""

    def report(self) -> list[Status]:
        """Return the statuses since the last report, and start the next interval."""
        return []
