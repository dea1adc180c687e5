# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Memory of a simulation: parameters, state and scratch vectors, each named once. Kernels find all by one address."""

import numpy as np

from diag_dynamics.numerics.tables import Addresses, Table, array
from diag_dynamics.simulation.tableau import STAGES
from diag_dynamics.sweeps import workspace as ws

EFFORT, WRENCHES, DAMPING, FRICTION, LIMITS, ACCOUNTS = range(6)
"""Energy accounts [J]: work of efforts, of wrenches, of damping, of friction, and of limits without what they store."""

BY_DOF = (
    # Parameters.
    "damping",  # [N m s/rad, N s/m]
    "friction",  # Coulomb friction [N m, N]
    "lower",  # limits [rad, m]; infinite where the joint has none
    "upper",
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
    "needed",  # M q̇ after the step [N m s, N s]
    "qdd",  # q̈ [rad/s², m/s²]
    "after",  # q̇ after the step [rad/s, m/s]
    "before",  # q̇ before the step or the impact [rad/s, m/s]
    "locks",  # not 0: this joint is locked
    "zeros",
    "u",  # change of positions, on the chart of joints of several degrees of freedom [rad, m]
    # Scratch of a step of order 4.
    "path",  # ∫q̇ [rad, m]
    "stage_nu",  # ν at a stage [J^½]
    "explicit_nu",  # ν at a stage before its implicit part [J^½]
    "constant_effort",  # efforts of drives and friction [N m, N]
)
"""Vectors of shape (nv,)."""

BY_STAGE = ("rates", "charts", "explicit", "implicit", "stage_pushed")
"""Matrices of shape (STAGES, nv): q̇, the rate of u, the explicit and implicit parts of ν̇, and efforts of the wrenches."""

SIMULATION = Table(
    "Simulation",
    robot=int,
    damped_robot=int,  # the same robot with other scratch, for inertia added by dampers
    flat=int,  # no joint has several degrees of freedom
    steps=array(np.int64),  # number of steps taken
    coordinate=array(np.int64),  # of each degree of freedom that can have limits
    **dict.fromkeys(("state", "q", "qd", "nu"), array(float)),  # q, q̇ and ν are views of `state`
    last=array(float),  # state before the step, in case that fails
    **dict.fromkeys(("accounts", "last_accounts"), array(float)),
    armature=array(float),  # of the bodies: a locked joint's is replaced
    **dict.fromkeys(("place", "first_q"), array(float)),  # q at a stage and at the start of a step [rad, m]
    **dict.fromkeys(BY_DOF, array(float)),
    **dict.fromkeys(BY_STAGE, array(float, 2)),
    moment=array(float),  # result of first_moment
)

opened = SIMULATION.opened


class Memory:
    """Arrays of a simulation of a robot, found by name: ``memory["q"]``. Kernels use `address` while the object lives."""

    def __init__(self, nq, nv):
        self._arrays = {
            "state": np.zeros(nq + 2 * nv),
            "last": np.zeros(nq + 2 * nv),
            "steps": np.zeros(1, np.int64),
            "accounts": np.zeros(ACCOUNTS),
            "last_accounts": np.zeros(ACCOUNTS),
            "place": np.zeros(nq),
            "first_q": np.zeros(nq),
            "moment": np.zeros(3),
            **{name: np.zeros(nv) for name in BY_DOF},
            **{name: np.zeros((STAGES, nv)) for name in BY_STAGE},
        }

    def use(self, bodies, gravity):
        """Simulate the robot of these bodies: a copy, in which joints can be locked."""
        # The limits' stiffness is that of degrees of freedom, their bounds those of coordinates.
        single = (bodies["dofs"] == 1) & (bodies["leader"] == np.arange(len(bodies)))
        coordinate = np.zeros(len(self._arrays["zeros"]), np.int64)
        coordinate[bodies["dof"][single]] = bodies["q"][single]
        self.limited = bodies["dof"][single]
        self._arrays |= {"coordinate": coordinate, "armature": bodies["armature"].copy()}
        self.flat = bool((bodies["dofs"][1:] == 1).all())
        self.workspace = ws.Workspace(bodies.copy(), gravity)
        self._locate()

    def _locate(self):
        nv = len(self._arrays["zeros"])
        nq = len(self._arrays["state"]) - 2 * nv
        views = zip(("q", "qd", "nu"), np.split(self._arrays["state"], [nq, nq + nv]), strict=True)
        self._views = self._arrays | dict(views)
        self._damped = ws.Workspace(self.workspace.bodies, self.workspace.gravity)
        robots = {"robot": self.workspace.robot, "damped_robot": self._damped.robot}
        self._table = Addresses(SIMULATION, **robots, flat=int(self.flat), **self._views)
        self.address = self._table.at

    def __getitem__(self, name):
        return self._views[name]

    def __getstate__(self):
        return {name: self.__dict__[name] for name in ("_arrays", "workspace", "flat", "limited")}

    def __setstate__(self, copied):
        self.__dict__.update(copied)
        self._locate()
