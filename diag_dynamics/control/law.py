# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What all laws share: a robot with a motor at every joint, gains, and the way from ε to efforts."""

from __future__ import annotations

from diag_dynamics.arrays import Array, VectorLike
from diag_dynamics.checks import instance
from diag_dynamics.control.command import Command, PoseError
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import UnsupportedError


def actuated(dynamics: DiagonalDynamics) -> DiagonalDynamics:
    """The dynamics of a robot that has a motor at every degree of freedom, as far as its description tells.

    Raises
    ------
    InputError
        `dynamics` is no DiagonalDynamics.
    UnsupportedError
        Nothing drives one of its joints.
    """
    model = instance("dynamics", dynamics, DiagonalDynamics).model
    if model.floating_base:
        raise UnsupportedError(
            f"robot '{model.name}' has a floating base, which no motor drives: control needs a fixed base."
        )
    for joint in model.joint_names:
        if joint not in model.dof_names:
            raise UnsupportedError(
                f"joint '{joint}' of robot '{model.name}' has several degrees of freedom, which no motor drives; lock it."
            )
    return dynamics


class Law:
    """A control law in (ν, ε) for one robot.

    It uses a :class:`DiagonalDynamics`, and thereby that one's workspace: one thread. All it calls is compiled when it is
    made, so that no call in a control loop waits for the compiler.

    Raises
    ------
    InputError
        `dynamics` is none.
    UnsupportedError
        The robot has a floating base, or another joint of several degrees of freedom: nothing drives these.
    """

    METHODS: tuple[str, ...] = "nu_from_qd", "tau_from_epsilon", "gravity_torque"

    def __init__(self, dynamics: DiagonalDynamics) -> None:
        self.dynamics = actuated(dynamics)
        dynamics.compile(*self.METHODS)

    def _command(
        self,
        q: VectorLike,
        nu: Array,
        epsilon: Array,
        lyapunov: float,
        rate: float,
        error: Array | PoseError | None = None,
    ) -> Command:
        """Command of working moments without gravity: τ = mε + g."""
        g = self.dynamics.gravity_torque(q)
        tau = self.dynamics.tau_from_epsilon(q, epsilon)
        tau += g
        return Command(tau, epsilon, g, nu, lyapunov, rate, error)
