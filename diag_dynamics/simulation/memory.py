# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Memory of a simulation: parameters, state and scratch vectors, each named once. Kernels find all by one address."""

import numpy as np

from diag_dynamics.numerics.tables import Addresses, Table, array
from diag_dynamics.simulation.tableau import STAGES
from diag_dynamics.sweeps import workspace as ws

EFFORT, WRENCHES, DAMPING, FRICTION, LIMITS = range(5)
"""Energy accounts [J]: work of efforts, of wrenches, of damping, of friction, and of limits without what they store."""

ACCOUNTS = 5

BY_DOF = (
    # Parameters.
    "damping",  # [N m s/rad, N s/m]
    "friction",  # Coulomb friction [N m, N]
    "stiffness",  # of the joint's limits [N m/rad, N/m]; inf is a hard limit
    "limit_damping",  # [N m s/rad, N s/m]
    # Modes in the present step: see modes.py.
    "mode",
    "spring",
    "depth",
    # Scratch of a step.
    "pushed",  # efforts of the wrenches [N m, N]
    "effort",  # sum of efforts [N m, N]
    "added",  # inertia added to a joint's [kg m², kg]
    "bias",  # c + g − M q̇/h [N m, N]
    "momentum",  # [N m s, N s]
    "impulse",  # [N m s, N s]
    "needed",  # M q̇ after the step [N m s, N s]
    "qdd",  # q̈ [rad/s², m/s²]
    "after",  # q̇ after the step [rad/s, m/s]
    "before",  # q̇ before the step or the impact [rad/s, m/s]
    "locks",  # not 0: this joint is locked
    "zeros",
    "u",  # change of positions, on the chart of joints of several degrees of freedom [rad, m]
    # Scratch of a step of order 4.
    "path",  # ∫q̇ [rad, m]
    "square",  # ∫q̇² [rad²/s, m²/s]
    "stage_nu",  # ν at a stage [J^½]
    "explicit_nu",  # ν at a stage before its implicit part [J^½]
    "constant_effort",  # efforts of drives and friction [N m, N]
)
"""Vectors of shape (nv,)."""

BY_STAGE = ("rates", "charts", "explicit", "implicit", "stage_pushed")
"""Matrices of shape (STAGES, nv): q̇, the rate of u, the explicit and implicit parts of ν̇, and efforts of the wrenches."""

BY_COORDINATE = ("lower", "upper", "place", "first_q")
"""Vectors of shape (nq,): limits, positions at a stage and at the start of a step [rad, m]."""

SIMULATION = Table(
    "Simulation",
    robot=int,
    flat=int,  # no joint has several degrees of freedom
    steps=array(np.int64),  # number of steps taken
    **dict.fromkeys(("state", "q", "qd", "nu"), array(float)),  # q, q̇ and ν are views of `state`
    last=array(float),  # state before the step, in case that fails
    **dict.fromkeys(("accounts", "last_accounts"), array(float)),
    armature=array(float),  # of the bodies: a locked joint's is replaced
    **dict.fromkeys((*BY_DOF, *BY_COORDINATE), array(float)),
    **dict.fromkeys(BY_STAGE, array(float, 2)),
    rows=array(float, 2),  # results of sweeps.evaluate
    moment=array(float),  # result of sweeps.first_moment
)

opened = SIMULATION.opened


class Memory:
    """Arrays of a simulation of a robot, found by name: ``memory["q"]``.

    Attributes
    ----------
    address : int
        Address of a :data:`SIMULATION`. Keep the object while kernels use it.
    workspace : Workspace
    """

    def __init__(self, nq, nv):
        self._sizes = nq, nv
        self._arrays = {
            "state": np.zeros(nq + 2 * nv),
            "last": np.zeros(nq + 2 * nv),
            "steps": np.zeros(1, np.int64),
            "accounts": np.zeros(ACCOUNTS),
            "last_accounts": np.zeros(ACCOUNTS),
            "rows": np.zeros((ws.N_ROWS, nq)),
            "moment": np.zeros(3),
        }
        for names, shape in ((BY_DOF, nv), (BY_COORDINATE, nq), (BY_STAGE, (STAGES, nv))):
            self._arrays.update({name: np.zeros(shape) for name in names})

    def use(self, bodies, gravity):
        """Simulate the robot of these bodies: a copy, in which joints can be locked."""
        self.workspace = ws.Workspace(bodies.copy(), gravity)
        self._arrays["armature"], self.flat = bodies["armature"].copy(), bool((bodies["dofs"][1:] == 1).all())
        self._write_table()

    def _write_table(self):
        nq, nv = self._sizes
        views = zip(("q", "qd", "nu"), np.split(self._arrays["state"], [nq, nq + nv]), strict=True)
        self._views = self._arrays | dict(views)
        self._table = Addresses(SIMULATION, robot=self.workspace.robot, flat=int(self.flat), **self._views)
        self.address = self._table.at

    def __getitem__(self, name):
        return self._views[name]

    def __getstate__(self):
        return {name: self.__dict__[name] for name in ("_sizes", "_arrays", "workspace", "flat")}

    def __setstate__(self, copied):
        self.__dict__.update(copied)
        self._write_table()
