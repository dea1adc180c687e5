# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Simulation of a robot: its state, efforts, friction and limits, and the audit of its energy."""

from __future__ import annotations

import copy
import math
from typing import NamedTuple

import numpy as np

from diag_dynamics.arrays import Array, Frame, VectorLike, Wrenches
from diag_dynamics.checks import in_order, instance, per_name, positive, vector
from diag_dynamics.dynamics.arguments import States
from diag_dynamics.dynamics.calls import raise_failure
from diag_dynamics.dynamics.flexible_joints import FlexibleDynamics
from diag_dynamics.exceptions import InputError, UnsupportedError
from diag_dynamics.model import RobotModel
from diag_dynamics.model.joint_types import places, single_joints
from diag_dynamics.model.link_modes import bending_energy, warn_of_slopes
from diag_dynamics.model.links import wrenches_on_links
from diag_dynamics.results import Evaluation
from diag_dynamics.simulation import steps as compiled
from diag_dynamics.simulation.step_memory import Memory
from diag_dynamics.sweeps.records import WRENCH

_NO_WRENCHES = np.zeros(0, WRENCH)


def rest_position(model):
    """Return `start`, or the middle of a joint's limits if it is outside; [rad, m], shape (nq,)."""
    lower = np.maximum(model.lower, -1e6)
    upper = np.minimum(model.upper, 1e6)
    start = model.start
    return np.where((lower > start) | (upper < start), 0.5 * (lower + upper), start)


class CompliantLimits(NamedTuple):
    """Position limits with a spring and a damper, which push a joint into its range and never pull.

    Each number is for all joints, or an array of shape (nv,). Of degrees of freedom without limits
    it has no effect.
    """

    stiffness: VectorLike | float
    """[N m/rad, N/m], greater than zero; inf is a hard limit."""
    damping: VectorLike | float = 0.0
    """[N m s/rad, N s/m]."""


class EnergyAudit(NamedTuple):
    """Work on a robot, and change of its energy, since the last reset [J].

    The work of a force is that of its mean over each step. The work of an impulse is the energy
    that it takes.
    """

    work: float
    """Work of the joint efforts, as saturated, and of the external wrenches."""
    loss: float
    """Work of damping, friction and limits, but for elastic energy; negative.

    Limits bring joints back without speed: that can add energy in the field of gravity.
    """
    exchanged: float
    """Energy that came with another model: see :meth:`Simulation.change_model`."""
    energy: float
    """Change of kinetic energy, of energy in the field of gravity, and of elastic energy."""

    @property
    def residual(self) -> float:
        """Change of energy less work, loss and exchanged energy: the error of the method [J]."""
        return self.energy - self.work - self.loss - self.exchanged


GEAR_FRICTION = "load_friction", "root_friction", "follower_damping", "follower_friction"
"""Parts of friction that change with the state."""

SLOWEST = 1e-4
"""Rate below which root friction of a model with friction_velocity 0 is viscous [rad/s, m/s]."""


class Simulation:
    """Simulate a robot: advance its state under efforts and wrenches in fixed steps.

    Laws, observers and thresholds are tried on it, and its audit states where energy went.

    Every model that :class:`DiagonalDynamics` takes can move: floating bases, planar and floating
    joints, coupled mimic joints, payloads, locked and flexible joints. The same inputs give the
    same bits. A wrong argument is an InputError that names it, and leaves the state as it was.
    Arrays that properties return are copies.

    Parameters
    ----------
    model : RobotModel
    q : array_like, shape (nq,), optional
        Initial positions [rad, m]; by default at zero or, where that is outside the limits, in the
        middle of them.
    qd : array_like, shape (nv,), optional
        Initial rates [rad/s, m/s], of a floating base the twist in its own axes; by default at
        rest.
    step : float
        Step size h [s].
    damping : float or array_like, shape (nv,), optional
        Joint damping d [N m s/rad, N s/m], by default that of the model. Load and root friction,
        and friction of followers with changing ratios, are always the model's, held during a step.
    limits : bool or CompliantLimits
        Whether there are position limits: hard stops without rebound, or springs with dampers.
    friction : float or array_like, shape (nv,), optional
        Coulomb friction f [N m, N], by default that of the model.
    effort_limits : bool, float or array_like, shape (nv,)
        Largest efforts [N m, N], to which commands are cut. True: those of the URDF, where 0 is no
        limit. False: none.
    effort_offset : float or array_like, shape (nv,), optional
        Part of a command that has no effect, and of the effort that is measured [N m, N]; by
        default that of the model.

    Attributes
    ----------
    flexible : FlexibleDynamics
        Of the model. Of a flexible joint q, q̇ and ν are of the link, on which damping, friction
        and limits act; efforts act on the motor.
    dynamics : DiagonalDynamics
        Of the links.
    effort_limits, effort_offset : ndarray, shape (nv,)
        Those of the arguments, read-only.

    Raises
    ------
    InputError
        An argument has a wrong value.
    UnsupportedError
        A coupled motor of the model has friction, or a follower of several joints.
    """

    def __init__(
        self,
        model: RobotModel,
        q: VectorLike | None = None,
        qd: VectorLike | None = None,
        step: float = 1e-3,
        damping: VectorLike | float | None = None,
        limits: bool | CompliantLimits = True,
        friction: VectorLike | float | None = None,
        effort_limits: bool | VectorLike | float = True,
        effort_offset: VectorLike | float | None = None,
    ) -> None:
        instance("model", model, RobotModel)
        self._use(FlexibleDynamics(model))
        self._memory = Memory(self.dynamics.model)
        self._set_friction_of_followers()
        self.step_size = positive("step", step, "[s]")
        self.damping = model.damping if damping is None else damping
        self.friction = model.friction if friction is None else friction
        offset = model.effort_offset if effort_offset is None else effort_offset
        expected = "a finite number [N m, N]"
        self.effort_offset = per_name(
            "effort_offset", offset, model.dof_names, expected, math.isfinite
        )
        if isinstance(effort_limits, (bool, np.bool_)):
            effort_limits = model.effort_bound if effort_limits else np.inf
        expected = "True, False or a number >= 0 [N m, N]"
        self.effort_limits = per_name(
            "effort_limits", effort_limits, model.dof_names, expected, lambda x: x >= 0.0
        )
        for name in ("load_friction", "root_friction"):
            self._memory[name][:] = getattr(model, name)
        self._memory["slowest"][:] = max(model.friction_velocity, SLOWEST)
        self._is_geared = any(self._memory[name].any() for name in GEAR_FRICTION)
        self._set_limits(limits)
        flexible = self.flexible
        self._memory["spring_stiffness"][flexible.dofs] = flexible.stiffness
        self._memory["spring_damping"][flexible.dofs] = flexible.damping
        self._memory["rotor_inertia"][flexible.dofs] = flexible.rotor_inertia
        self._no_effort = np.zeros(model.nv)
        self.reset(rest_position(model) if q is None else q, self._no_effort if qd is None else qd)

    def _use(self, flexible):
        self.flexible = flexible
        self.model = flexible.model
        self.dynamics = flexible.link

    def __copy__(self):
        """A simulation of its own: a shallow copy would share the state, and the robot."""
        return copy.deepcopy(self)

    def _set_friction_of_followers(self):
        model = self.model
        for name, damping, friction in zip(
            model.followers, model.follower_damping, model.follower_friction, strict=True
        ):
            if (damping or friction) and len(model.followers[name]) > 1:
                raise UnsupportedError(
                    f"joint '{name}' follows several joints and has friction, which a simulation "
                    "lacks. Omit its friction."
                )
            body = model.first_body(name)
            self._memory["follower_damping"][body] = damping
            self._memory["follower_friction"][body] = friction

    def _set_limits(self, limits):
        """Set stiffness and damping of all degrees of freedom, and bounds of coordinates."""
        memory = self._memory
        model = self.model
        joints = single_joints(model)
        dofs = places(joints, model.dof_names)
        coordinates = places(joints, model.coordinate_names)
        memory["coordinate"][dofs] = coordinates
        is_on = True
        if isinstance(limits, (bool, np.bool_)):
            is_on = bool(limits)
            limits = CompliantLimits(np.inf)
        elif not isinstance(limits, CompliantLimits):
            raise InputError(
                f"limits is {limits!r}; expected True, False or "
                "CompliantLimits(stiffness, damping)."
            )
        expected = "a number > 0 [N m/rad, N/m]"
        names = model.dof_names
        memory["stiffness"][:] = per_name(
            "stiffness of limits", limits.stiffness, names, expected, lambda x: x > 0.0
        )
        memory["limit_damping"][:] = _not_negative(
            "damping of limits", limits.damping, names, "[N m s/rad, N s/m]"
        )
        memory["lower"][:] = -np.inf
        memory["upper"][:] = np.inf
        if is_on:
            memory["lower"][dofs] = model.lower[coordinates]
            memory["upper"][dofs] = model.upper[coordinates]
        for link in model.flexible_links.values():
            for name, frequency, ratio in zip(
                link.modes, link.frequencies, link.damping_ratio, strict=True
            ):
                if name in names:
                    k = names.index(name)
                    memory["lower"][k] = memory["upper"][k] = 0.0
                    memory["stiffness"][k] = frequency**2
                    memory["limit_damping"][k] = 2.0 * ratio * frequency

    def reset(
        self,
        q: VectorLike,
        qd: VectorLike,
        theta: VectorLike | None = None,
        thetad: VectorLike | None = None,
    ) -> None:
        """Put the robot into a state, and set the time and the audit to zero.

        Parameters
        ----------
        q : array_like, shape (nq,)
            Positions [rad, m]; orientations are brought to unit length.
        qd : array_like, shape (nv,)
            Rates [rad/s, m/s].
        theta, thetad : array_like, shape (nf,), optional
            Positions and rates of the motors of flexible joints; by default springs carry gravity,
            motors turn with links.
        """
        memory = self._memory
        flexible = self.flexible
        q = in_order("q", q, self.model.coordinate_names)
        qd = in_order("qd", qd, self.model.dof_names)
        memory["nu"][:] = self.dynamics.nu_from_qd(q, qd)
        memory["q"][:] = _with_unit_quaternions(self.model, q)
        memory["qd"][:] = qd
        if flexible.names:
            if theta is None:
                carried = self.dynamics.gravity_torque(self.q)[flexible.dofs]
                theta = self.q[flexible.coordinates] + carried / flexible.stiffness
            if thetad is None:
                thetad = self.qd[flexible.dofs]
            memory["theta"][flexible.dofs] = vector("theta", theta, flexible.names)
            memory["thetad"][flexible.dofs] = vector("thetad", thetad, flexible.names)
        self._effort = self._wanted = self._no_effort
        memory["accounts"][:] = 0.0
        memory["steps"][:] = 0
        self._exchanged = 0.0
        self._start = self._state()
        self._start_energies = None

    def _state(self):
        return self.q, self.nu, self.theta, self.thetad

    def change_model(self, model: RobotModel) -> None:
        """Simulate another model of the same degrees of freedom, such as another payload.

        q and q̇ stay, so kinetic and potential energy jump as mass comes with the robot's own speed
        and height; the audit has the difference as `exchanged`. Damping, friction and limits in
        force stay, too.

        Raises
        ------
        SingularMassMatrixError
            Its mass matrix is singular here; the model is then as it was.
        """
        instance("model", model, RobotModel)
        if _structure(model) != _structure(self.model):
            raise InputError(
                f"change_model: robot '{model.name}' has other degrees of freedom, or other "
                f"flexible or mimic joints; expected those of '{self.model.name}'."
            )
        flexible = FlexibleDynamics(model)
        nu = flexible.link.nu_from_qd(self.q, self.qd)
        self._start_energies = self._energies_at_start()
        before = self._energies().sum()
        self._use(flexible)
        self._memory.use(self.dynamics.model)
        self._memory["nu"][:] = nu
        self._exchanged += float(self._energies().sum() - before)

    @property
    def time(self) -> float:
        """Simulated time since the last reset [s]: a whole number of steps."""
        return float(self._memory["steps"][0]) * self.step_size

    @property
    def damping(self) -> Array:
        """Joint damping in force [N m s/rad, N s/m], shape (nv,)."""
        return self._memory["viscous"].copy()

    @damping.setter
    def damping(self, value: VectorLike | float) -> None:
        self._memory["viscous"][:] = self._memory["damping"][:] = _not_negative(
            "damping", value, self.model.dof_names, "[N m s/rad, N s/m]"
        )

    @property
    def friction(self) -> Array:
        """Coulomb friction in force [N m, N], shape (nv,)."""
        return self._memory["coulomb"].copy()

    @friction.setter
    def friction(self, value: VectorLike | float) -> None:
        self._memory["coulomb"][:] = self._memory["friction"][:] = _not_negative(
            "friction", value, self.model.dof_names, "[N m, N]"
        )

    @property
    def q(self) -> Array:
        """Positions [rad, m], shape (nq,)."""
        return self._memory["q"].copy()

    @property
    def nu(self) -> Array:
        """Total joint rates [J^½], shape (nv,)."""
        return self._memory["nu"].copy()

    @property
    def qd(self) -> Array:
        """Joint rates q̇ = ℓᵀν [rad/s, m/s], shape (nv,); exactly zero where a joint sticks."""
        return self._memory["qd"].copy()

    @property
    def theta(self) -> Array:
        """Positions θ of the motors of flexible joints [rad, m], shape (nf,)."""
        return self._memory["theta"][self.flexible.dofs]

    @property
    def thetad(self) -> Array:
        """Rates θ̇ of these motors [rad/s, m/s], shape (nf,)."""
        return self._memory["thetad"][self.flexible.dofs]

    @property
    def spring_torque(self) -> Array:
        """Torques τ_J of the springs of flexible joints [N m, N], shape (nf,)."""
        return self.flexible.spring_torque(self.q, self.theta, self.qd, self.thetad)

    @property
    def effort(self) -> Array:
        """Joint efforts of the last steps [N m, N], shape (nv,), after saturation."""
        return self._effort.copy()

    @property
    def saturated(self) -> tuple[str, ...]:
        """Names of the degrees of freedom whose effort was cut in the last steps."""
        return self._named(self._effort != self._wanted)

    @property
    def overspeed(self) -> tuple[str, ...]:
        """Names of the degrees of freedom above the velocity limit of the URDF, if it has one."""
        return self._named(np.abs(self._memory["qd"]) > self.model.velocity_bound)

    @property
    def at_limit(self) -> tuple[str, ...]:
        """Names of the joints at or beyond a position limit."""
        return self._named(self._beyond_limits(self._memory["q"]) >= 0.0)

    def _beyond_limits(self, q):
        """Return distances of degrees of freedom beyond the nearest limit; negative within."""
        memory = self._memory
        q = q[self._memory["coordinate"]]
        return np.maximum(q - memory["upper"], memory["lower"] - q)

    def _named(self, chosen):
        return tuple(self.model.dof_names[k] for k in np.flatnonzero(chosen))

    def advance(
        self,
        tau: VectorLike | None = None,
        steps: int = 1,
        f_ext: Wrenches | None = None,
        frame: Frame = "link",
    ) -> None:
        """Take `steps` steps with joint efforts and wrenches held, in one call of compiled code.

        Parameters
        ----------
        tau : array_like, shape (nv,), optional
            Joint efforts [N m, N], cut to the effort limits; zero by default.
        steps : int
        f_ext : dict, optional
            External wrenches by link name: force [N], then moment [N m], at the link's origin.
        frame : {"link", "world"}
            Axes in which they are held, while the link turns.

        Raises
        ------
        InputError
            An argument is wrong, or the motion has left what numbers can hold.
        SingularMassMatrixError
            The robot has arrived where its mass matrix is singular. Either way the state is the
            last good one.
        """
        command = self._no_effort if tau is None else vector("tau", tau, self.model.dof_names)
        if not (isinstance(steps, (int, np.integer)) and 0 <= steps < 2**63):
            raise InputError(f"steps is {steps!r}; expected a whole number >= 0 and below 2**63.")
        wrenches = _NO_WRENCHES
        if f_ext is not None or frame != "link":
            wrenches = wrenches_on_links(self.model, {} if f_ext is None else f_ext, frame)
        effort = np.clip(command, -self.effort_limits, self.effort_limits)
        memory = self._memory
        tau = effort - self.effort_offset
        status = compiled.advance(
            *(memory.address, self.step_size, steps, tau, wrenches, frame == "world"),
            self._is_geared,
        )
        self._effort = effort
        self._wanted = command
        if status:
            state = States(memory["q"], {"nu": memory["nu"]})
            D = memory.workspace.work["D"][status] if status > 0 else np.nan
            raise_failure(self.model, status, float(D), state)
        if self.model.flexible_links:
            warn_of_slopes(self.model, memory["q"])

    def with_spring_torques(self, tau: VectorLike) -> Array:
        """Return efforts on links [N m, N], shape (nv,): at flexible joints the spring torque."""
        effort = vector("tau", tau, self.model.dof_names)
        effort[self.flexible.dofs] = self.spring_torque
        return effort

    def evaluate(
        self, tau: VectorLike | None = None, f_ext: Wrenches | None = None, *, frame: Frame = "link"
    ) -> Evaluation:
        """Evaluate the equations of the links at the present state.

        See :meth:`DiagonalDynamics.evaluate`.

        The effort of flexible joints is the spring torque, in place of that in `tau`.
        """
        tau = None if tau is None else self.with_spring_torques(tau)
        return self.dynamics.evaluate(self.q, self.qd, tau, f_ext, frame=frame)

    def __repr__(self) -> str:
        model = self.model
        return f"<Simulation '{model.name}': {model.nv} dof, time {self.time:.6g} s>"

    @property
    def kinetic_energy(self) -> float:
        """K = ½νᵀν [J], with the rotors of flexible joints, ½Bθ̇²."""
        return float(self._energies()[0])

    @property
    def potential_energy(self) -> float:
        """Energy in the field of gravity [J], as of :meth:`DiagonalDynamics.potential_energy`."""
        energy: float = self.dynamics.potential_energy(self._memory["q"])
        return energy

    @property
    def elastic_energy(self) -> float:
        """Elastic energy of compliant limits, flexible joints and links [J]."""
        return float(self._energies()[2])

    def _energies(self, state=None):
        """Return kinetic, potential and elastic energy [J], by default of the present state."""
        q, nu, theta, thetad = state or self._state()
        flexible = self.flexible
        elastic = flexible.stiffness @ (theta - q[flexible.coordinates]) ** 2
        elastic = 0.5 * elastic + self._limit_energy(q) + self._bending_energy(q)
        kinetic = nu @ nu + flexible.rotor_inertia @ thetad**2
        return np.array([0.5 * kinetic, self.dynamics.potential_energy(q), elastic])

    def _limit_energy(self, q):
        """Return the energy of compliant limits and of linear springs of flexible links [J]."""
        depth = self._beyond_limits(q)
        stiffness = self._memory["stiffness"]
        leaning = np.isfinite(stiffness) & (depth > 0.0)
        return 0.5 * stiffness[leaning] @ depth[leaning] ** 2

    def _bending_energy(self, q):
        """Return the strain energy of flexible links beyond that of linear springs [J]."""
        memory = self._memory
        return bending_energy(*(memory["bends"] @ q[memory["coordinate"]]).T)

    def _energies_at_start(self):
        """Return energies at the last reset; computed on first use because resets must be fast."""
        if self._start_energies is None:
            self._start_energies = self._energies(self._start)
        return self._start_energies

    @property
    def audit(self) -> EnergyAudit:
        """Work and change of energy since the last :meth:`reset`, an :class:`EnergyAudit`."""
        energy = (self._energies() - self._energies_at_start()).sum()
        work, loss = self._memory["accounts"].tolist()
        q = self._memory["q"]
        start = self._start[0]
        work += float(self._bending_energy(q) - self._bending_energy(start))
        loss += float(self._limit_energy(q) - self._limit_energy(start))
        return EnergyAudit(work, loss, self._exchanged, float(energy))


def _not_negative(name, value, names, unit):
    """Return one finite number >= 0 for all names, or one for each, as a vector."""
    return per_name(name, value, names, f"a finite number >= 0 {unit}", lambda x: 0.0 <= x < np.inf)


def _structure(model):
    """Return the properties that models of one simulation have in common."""
    return model.dof_names, model.coordinate_names, model.flexible_joints, len(model.bodies)


def _with_unit_quaternions(model, q):
    """Return a copy of q with quaternions of unit length."""
    q = np.array(q, dtype=float)
    for k, component in enumerate(model.orientations):
        if component == 3:
            q[k - 3 : k + 1] /= np.linalg.norm(q[k - 3 : k + 1])
    return q
