# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Memory of a simulation: parameters, state and scratch vectors, by one address for kernels."""

import numpy as np

from diag_dynamics.numerics.tables import Addresses, Table, array

WORK, LOSS, N_ACCOUNTS = range(3)
"""Energy accounts [J]: work of efforts and wrenches; loss by damping, friction and
limits, whose elastic energy is no part of the loss in the audit."""

STATE = "q", "qd", "nu", "accounts", "theta", "thetad"
"""Parts of the vector `state`: q, q̇, ν, the energy accounts, and θ and θ̇ of flexible joints."""

BY_DOF = (
    # Parameters.
    "damping",  # in the present step, with root friction over the rate [N m s/rad, N s/m]
    "friction",  # Coulomb friction in the present step, with that by load [N m, N]
    "viscous",  # constant part of the damping
    "coulomb",  # constant part of the friction
    "load_friction",  # Coulomb friction over the torque of gravity
    "root_friction",  # [N m √(s/rad), N √(s/m)]
    "slowest",  # rate below which root friction is viscous [rad/s, m/s]
    "lower",  # limits [rad, m]; infinite where the joint has none
    "upper",
    "stiffness",  # of the joint's limits [N m/rad, N/m]; inf is a hard limit
    "limit_damping",  # [N m s/rad, N s/m]
    "rotor_inertia",  # B of flexible joints, 0 of others [kg m², kg]
    "spring_stiffness",  # of flexible joints [N m/rad, N/m]
    "spring_damping",  # [N m s/rad, N s/m]
    # Modes in the present step: see joint_modes.py.
    "mode",
    "spring",
    "depth",
    "weight",  # of q̇ after the step in forces of springs and dampers: see midpoint.py
    "motor_weight",  # that of the spring between motor and link
    "fraction",  # of the step in which a compliant limit acts
    # Scratch of a step.
    "link_effort",  # of drives, and of springs by the motors' inertia [N m, N]
    "reflected",  # inertia of a motor through its spring [kg m², kg]
    "pushed",  # efforts of the wrenches [N m, N]
    "added",  # inertia added to a joint's [kg m², kg]
    "bias",  # c + g − M q̇/h [N m, N]
    "momentum",  # [N m s, N s]
    "needed",  # M q̇ after the step [N m s, N s]
    "qdd",  # q̈ [rad/s², m/s²]
    "after",  # q̇ after the step [rad/s, m/s]
    "before",  # q̇ before the step or the impact [rad/s, m/s]
    "middle",  # q̇ at `place` [rad/s, m/s]
    "locks",  # not 0: an impact stops this joint
    "zeros",
    "u",  # change of positions, on the chart of joints of several degrees of freedom [rad, m]
)
"""Vectors of shape (nv,)."""

SIMULATION = Table(
    "Simulation",
    robot=int,
    steps=array(np.int64),  # number of steps taken
    coordinate=array(np.int64),  # of each degree of freedom that can have limits
    **dict.fromkeys(("state", *STATE), array(float)),
    last=array(float),  # state before the step, in case that fails
    **dict.fromkeys(
        ("follower_damping", "follower_friction"), array(float)
    ),  # by body, where its ratio changes
    **dict.fromkeys(
        ("place", "first_q"), array(float)
    ),  # q of an evaluation and at the start of a step [rad, m]
    **dict.fromkeys(BY_DOF, array(float)),
    moment=array(float),  # result of first_moment
    bends=array(float, 3),  # curvature and slope of points of flexible links by q
)

opened = SIMULATION.opened


class Memory:
    """Arrays of a simulation by name: ``memory["q"]``.

    Kernels use `address` while the object lives.
    """

    def __init__(self, model):
        nq = model.nq
        nv = model.nv
        self._arrays = {
            "state": np.zeros(nq + 4 * nv + N_ACCOUNTS),
            "last": np.zeros(nq + 4 * nv + N_ACCOUNTS),
            "steps": np.zeros(1, np.int64),
            "coordinate": np.zeros(nv, np.int64),
            "place": np.zeros(nq),
            "first_q": np.zeros(nq),
            "moment": np.zeros(3),
            "follower_damping": np.zeros(len(model.bodies)),
            "follower_friction": np.zeros(len(model.bodies)),
            "bends": _bends(model),
            **{name: np.zeros(nv) for name in BY_DOF},
        }
        self.use(model)

    def use(self, model):
        """Simulate a model with the same joints; parameters and state stay."""
        self.workspace = model.new_workspace()
        self._locate()

    def _locate(self):
        nq = len(self._arrays["place"])
        nv = len(self._arrays["zeros"])
        parts = np.split(self._arrays["state"], np.cumsum([nq, nv, nv, N_ACCOUNTS, nv]))
        self._named = self._arrays | dict(zip(STATE, parts, strict=True))
        self._table = Addresses(SIMULATION, robot=self.workspace.robot, **self._named)
        self.address = self._table.at

    def __getitem__(self, name):
        return self._named[name]

    def __getstate__(self):
        return {"_arrays": self._arrays, "workspace": self.workspace}

    def __setstate__(self, copied):
        self.__dict__.update(copied)
        self._locate()


def _bends(model):
    """Return `bends`, (points, 2, nv), of :func:`bending_energy`."""
    bends = [np.zeros((0, 2, model.nv))]
    for link in model.flexible_links.values():
        bends.append(np.zeros((len(link.bends), 2, model.nv)))
        bends[-1][:, :, [model.dof_names.index(mode) for mode in link.modes]] = link.bends
    return np.concatenate(bends)
