# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""State of a robot with a floating base: that of its joints, completed by odometry."""

import numpy as np

from diag_dynamics.assembly.assembler import RobotState
from diag_dynamics.assembly.stamps import SECOND


class WithBase:
    """Completes states of joints by that of the base.

    Parameters
    ----------
    base : OdometryBase
    assembler : JointStateAssembler
    """

    def __init__(self, base, assembler):
        self._base, self._assembler = base, assembler
        self._jumps = 0  # of the joints' time that the base knows of

    def state(self, state, timeout):
        """The state of the whole robot from that of its joints; None while the base's is unknown.

        Raises
        ------
        RejectedError
            The base's state is more than `timeout` [s] older or newer than the joints'; 0 for no limit.
        """
        jumps = self._assembler.counts["time jumped back"]
        if jumps > self._jumps and self._base.stamp is not None and self._base.stamp > state.newest + SECOND:
            self._base.forget()  # it is of the time that is over
        self._jumps = jumps
        return self._base.with_joints(state, timeout)

    def state_of_base(self, timeout):
        """The state after odometry: of a robot that is all base, for which no joint state will ever come, else None."""
        if self._assembler.names:
            return None
        nothing, at = np.zeros(0), self._base.stamp
        return self.state(RobotState(nothing, nothing, None, at, at, False), timeout)
