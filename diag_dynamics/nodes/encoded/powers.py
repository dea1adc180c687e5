# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Powers of gravity and of the model's friction at a state, which no message holds: the balance of power wants them."""

import math

import numpy as np

from diag_dynamics import sweeps
from diag_dynamics.compiled.kernel import COUNT, MATRIX, entry_kernel, kernel, ready
from diag_dynamics.compiled.tables import Addresses, Table, array

RESISTANCE = Table(
    "Resistance",
    damping=array(float),  # of the model; these three are empty where there is no friction
    friction=array(float),
    effort_offset=array(float),
    friction_velocity=float,
    nv=int,
)
"""What :func:`powers` has to know of a robot."""


class Powers:
    """Gives the powers of gravity and friction at evaluated states of a robot.

    Parameters
    ----------
    model : RobotModel

    Attributes
    ----------
    addresses : Addresses
        Of :data:`RESISTANCE`.
    """

    def __init__(self, model):
        numbers = {"damping": model.damping, "friction": model.friction, "effort_offset": model.effort_offset}
        self.addresses = Addresses(
            RESISTANCE,
            **{name: np.array(x if model.has_friction else (), dtype=float) for name, x in numbers.items()},
            friction_velocity=float(model.friction_velocity),
            nv=model.nv,
        )
        ready(_powers)

    def at(self, s):
        """ν·ε_g and ν·ε_fric [W] of an Evaluation."""
        return _powers(s.rows, self.addresses.at)


_resistance_at = RESISTANCE.opened


@kernel
def powers(rows, velocity, resistance):
    """ν·ε_g and ν·ε_fric = q̇·τ_fric, with the friction that DiagonalDynamics.friction_torque has."""
    own, lifting, resisting = _resistance_at(resistance), 0.0, 0.0
    for k in range(own.nv):
        lifting += rows[sweeps.NU, k] * rows[sweeps.GRAVITY, k]
    v0 = own.friction_velocity
    for k in range(len(own.damping)):
        rate = velocity[k]
        turned = math.tanh(rate / v0) if v0 > 0.0 else float((rate > 0.0) - (rate < 0.0))
        resisting += rate * (own.damping[k] * rate + own.friction[k] * turned + own.effort_offset[k])
    return lifting, resisting


@entry_kernel(MATRIX, COUNT)
def _powers(rows, resistance):
    return powers(rows, rows[sweeps.RATES], resistance)
