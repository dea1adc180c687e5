# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Calls of sweeps at one state or at many: memory, checked arguments, errors."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import cached_property
from typing import Any, NamedTuple, NoReturn

import numpy as np

from diag_dynamics import checks, results, threads
from diag_dynamics.arrays import Array, Frame, ManyWrenches, PointLike
from diag_dynamics.contact.points import ContactPoint, ContactPoints
from diag_dynamics.contact.results import Contact
from diag_dynamics.exceptions import InputError, SingularMassMatrixError
from diag_dynamics.model import RobotModel
from diag_dynamics.model.links import wrenches_at, wrenches_on_links, wrenches_on_links_of_many
from diag_dynamics.sweeps import (
    batch,
    classical,
    contacts,
    derivatives,
    evaluation,
    factorization,
    factors,
    joints,
    kinematics,
    mobilities,
)
from diag_dynamics.sweeps import workspace as ws

ENTRIES = {
    evaluation.evaluate: "evaluate",
    batch.evaluate_many: "evaluate_batch",
    batch.mass_matrix_each: "mass_matrix_batch",
    batch.effort_of_wrenches_each: "evaluate_batch forward_dynamics_batch inverse_dynamics_batch",
    batch.sweep_each: (
        "bias_batch epsilon_from_tau_batch forward_dynamics_batch gravity_torque_batch inverse_dynamics_batch "
        "nu_from_qd_batch qd_from_nu_batch tau_from_epsilon_batch"
    ),
    evaluation.link_energies: "evaluate evaluate_batch",
    factors.factors: "factors",
    classical.forward_dynamics: "forward_dynamics",
    classical.inverse_dynamics: "inverse_dynamics bias gravity_torque",
    classical.effort_of_wrenches: "evaluate forward_dynamics inverse_dynamics",
    classical.mass_matrix: "mass_matrix",
    factorization.nu_from_qd: "nu_from_qd impact",
    factorization.qd_from_nu: "qd_from_nu impact",
    factorization.epsilon_from_tau: "epsilon_from_tau evaluate",
    factorization.tau_from_epsilon: "tau_from_epsilon",
    factorization.factor_of_wrenches: (
        "wrench_factor epsilon_from_wrench operational_inverse_inertia reflected_mass impact"
    ),
    derivatives.m_rate_transposed: "m_rate_transposed",
    derivatives.coriolis_bracket: "coriolis_bracket",
    derivatives.coriolis_product: "coriolis_product",
    derivatives.mass_matrix_rate: "mass_matrix_rate",
    derivatives.mass_matrix_rate_times: "mass_matrix_rate_times",
    derivatives.articulated_inertias: "log_det log_det_rate",
    kinematics.placement: "placement jacobian link_velocity link_acceleration",
    kinematics.jacobian: "jacobian",
    kinematics.motion: "link_velocity link_acceleration",
    mobilities.mobilities: "mobilities",
    contacts.contacts: "contact",
    contacts.contacts_each: "contact_batch",
}
"""Methods of DiagonalDynamics that call an entry, for compiling it in advance."""


ZEROS: Any = object()
"""Argument that stands for zeros."""


class States(NamedTuple):
    """Checked arguments of a sweep at one state, shapes (nq,) and (nv,), or at many with one row each.

    Vectors that are zero at many states have a single row. `threads` is 0 for one state.
    """

    q: Array
    vectors: Mapping[str, Array] = {}
    threads: int = 0

    def at(self, t: int) -> States:
        """Return the arguments at one of many states."""
        return States(self.q[t], {name: x[min(t, len(x) - 1)] for name, x in self.vectors.items()})

    def apart_from(self, memory: results.BatchMemory) -> States:
        """Return the arguments, with copies of those that may lie in memory that a sweep writes."""
        block = memory.results.base
        q, *vectors = (x.copy() if np.may_share_memory(x, block) else x for x in (self.q, *self.vectors.values()))
        return States(q, dict(zip(self.vectors, vectors, strict=True)), self.threads)


class Loads:
    """Wrenches and friction, as arguments of methods."""

    def __init__(self, f_ext: ManyWrenches | None, frame: Frame, friction: bool) -> None:
        checks.choice("frame", frame, ("link", "world"))
        self.frame, self.friction = frame, friction
        # All but None and an empty dict counts, to be checked.
        self.wrenches: Any = None if isinstance(f_ext, dict) and not f_ext else f_ext


class Sweep(NamedTuple):
    """A sweep that returns a vector: its kernel for one state, and its number in `batch.sweep_each`."""

    single: Callable[..., int]
    each: int
    weight: tuple[float, ...] = ()


FORWARD_DYNAMICS = Sweep(classical.forward_dynamics, batch.FORWARD)
INVERSE_DYNAMICS = Sweep(classical.inverse_dynamics, batch.INVERSE, (1.0,))
WITHOUT_GRAVITY = Sweep(classical.inverse_dynamics, batch.INVERSE, (0.0,))
NU_FROM_QD = Sweep(factorization.nu_from_qd, batch.NU_FROM_QD)
QD_FROM_NU = Sweep(factorization.qd_from_nu, batch.QD_FROM_NU)
EPSILON_FROM_TAU = Sweep(factorization.epsilon_from_tau, batch.EPSILON_FROM_TAU)
TAU_FROM_EPSILON = Sweep(factorization.tau_from_epsilon, batch.TAU_FROM_EPSILON)


class SweepCaller:
    """A robot with memory for its sweeps."""

    def __init__(self, model: RobotModel) -> None:
        self.model, self.nv = model, model.nv
        self._workspace = ws.Workspace(model.bodies, model.gravity)
        self.robot = self._workspace.robot
        self.workspaces = threads.Workspaces(model)
        self.zero = np.zeros(model.nv)

    # --- Arguments

    def one(self, q: Any, **vectors: Any) -> States:
        """Return checked arguments of one state, as new vectors."""
        names, q = self.model.dof_names, checks.vector("q", q, self.model.coordinate_names, finite=False)
        for name, x in vectors.items():
            vectors[name] = self.zero if x is ZEROS else checks.vector(name, x, names, finite=False)
        return States(q, vectors)

    def many(self, Q: Any, number: int | None, **vectors: Any) -> States:
        """Return checked arguments of many states."""
        Q, names = checks.rows("Q", Q, self.model.coordinate_names), self.model.dof_names
        for name, x in vectors.items():
            vectors[name] = self.zero[None] if x is ZEROS else checks.rows(name.upper(), x, names, len(Q))
        return States(Q, vectors, threads.cores() if number is None else checks.whole("threads", number))

    def states(self, q: Any, number: int | None, **vectors: Any) -> States:
        """Return checked arguments of one state or of many."""
        return self.many(q, number, **vectors) if checks.is_rows(q) else self.one(q, **vectors)

    # --- Sweeps

    def empty(self, at: States, *shape: int) -> Array:
        """Return uninitialized memory of a shape for each state."""
        return np.empty((*at.q.shape[:-1], *shape))

    def run(self, sweep: Sweep, at: States, again: Callable[[int], Any] | None = None) -> Array:
        """Return the vector of a sweep; `again` raises the error of one of many states."""
        result = self.empty(at, self.nv)
        if at.threads:
            A, B = (*at.vectors.values(), self.zero[None])[:2]
            inputs = sweep.each, at.q, A, B, sum(sweep.weight)
            self.run_chunks(batch.sweep_each, inputs, (result,), at, again or (lambda t: self.run(sweep, at.at(t))))
        else:
            self.check(sweep.single(self.robot, at.q, *at.vectors.values(), *sweep.weight, result), at)
        return result

    def run_chunks(
        self,
        kernel: Callable[..., int],
        inputs: Iterable[Any],
        outputs: Iterable[Array],
        at: States,
        again: Callable[[int], Any],
        width: int = 1,
    ) -> None:
        """Sweep over many states in threads; `again` raises the error of the first one that fails."""

        def call(robot: int, first: int, last: int) -> int:
            return kernel(robot, *inputs, first, last, *outputs)

        failing = threads.run_chunks(self.workspaces, len(at.q), call, at.threads, width)
        for t in failing:
            try:
                again(t)
            except SingularMassMatrixError as error:
                raise SingularMassMatrixError(f"state {t}: {error}", error.joint, error.articulated_inertia) from None
            except InputError as error:
                raise InputError(f"state {t}: {error}") from None
        if failing:
            raise InputError(f"arguments have changed while states {failing[0]} to {failing[-1]} were evaluated.")

    def check(self, status: int, at: States) -> None:
        """Raise the error of a sweep's status at one state, if there is one."""
        if status:
            # Factorized again in new memory: another thread may have used the shared one since.
            own = ws.Workspace(self.model.bodies, self.model.gravity)
            factorization.joint_inertias(own.robot, at.q, *np.empty((2, self.nv)))
            raise_failure(self.model, status, own.work, at)

    def mass_matrix(self, at: States) -> Array:
        """Return M."""
        M = self.empty(at, self.nv, self.nv)
        if at.threads:
            self.run_chunks(batch.mass_matrix_each, (at.q,), (M,), at, lambda t: self.mass_matrix(at.at(t)))
        else:
            self.check(classical.mass_matrix(self.robot, at.q, M), at)
        return M

    def derivative(self, sweep: Callable[..., int], at: States, scratch: int = 0) -> Array:
        """Return the vector of a sweep along q̇."""
        more, result = np.empty((scratch, self.nv)), np.empty(self.nv)
        self.check(sweep(self.robot, at.q, *at.vectors.values(), *more, result), at)
        return result

    def articulated_inertias(self, at: States) -> tuple[Array, Array]:
        """Return D and Ḋ."""
        D, D_rate = np.empty((2, self.nv))
        self.check(derivatives.articulated_inertias(self.robot, at.q, at.vectors["qd"], D, D_rate), at)
        return D, D_rate

    # --- Wrenches and friction

    def wrench_effort(self, at: States, loads: Loads) -> Array:
        """Return Jᵀf_ext."""
        f_ext, frame = loads.wrenches, loads.frame
        tau, in_world = self.empty(at, self.nv), frame == "world"
        if at.threads:
            records = wrenches_on_links_of_many(self.model, f_ext, frame, len(at.q))
            inputs = at.q, records, len(f_ext), in_world
            # Only q can be wrong.
            self.run_chunks(batch.effort_of_wrenches_each, inputs, (tau,), at, lambda t: self.mass_matrix(at.at(t)))
        else:
            records = wrenches_on_links(self.model, f_ext, frame)
            self.check(classical.effort_of_wrenches(self.robot, at.q, records, in_world, tau), States(at.q))
        return tau

    def _epsilon(self, at: States, tau: Array, cause: str) -> Array:
        """Return ε = ℓτ of wrenches or friction, as read-only memory; `cause` begins the error of many states."""

        def fail(t: int) -> None:
            raise InputError(f"{cause} too large: a result overflows.")

        return results.read_only(self.run(EPSILON_FROM_TAU, at._replace(vectors={"tau": tau}), fail))

    def friction(self, qd: Array) -> Array:
        """Return the friction that resists rates, shape (…, nv)."""
        model = self.model
        checks.check_finite("qd", qd, model.dof_names)
        v0 = model.friction_velocity
        with np.errstate(over="ignore"):
            direction = np.tanh(qd / v0) if v0 else np.sign(qd)
        return model.damping * qd + model.friction * direction + model.effort_offset

    def forward_dynamics(self, at: States, loads: Loads) -> Array:
        """Return q̈ with wrenches and friction."""
        qd, tau = at.vectors["qd"], at.vectors["tau"]
        if loads.friction or loads.wrenches is not None:
            for name, x in at.vectors.items():
                checks.check_finite(name, x, self.model.dof_names)
            if loads.friction:
                tau = tau - self.friction(qd)
            if loads.wrenches is not None:
                tau = tau + self.wrench_effort(at, loads)
            require_finite(at, tau, _SUM)
        return self.run(FORWARD_DYNAMICS, at._replace(vectors={"qd": qd, "tau": tau}))

    def inverse_dynamics(self, at: States, loads: Loads) -> Array:
        """Return τ with wrenches and friction."""
        tau = self.run(INVERSE_DYNAMICS, at)
        if loads.friction:
            tau += self.friction(at.vectors["qd"])
        if loads.wrenches is not None:
            tau -= self.wrench_effort(at, loads)
        require_finite(at, tau, _SUM)
        return tau

    # --- Evaluation

    def _fill(self, at: States, memory: Any) -> tuple[Array, Array]:
        """Evaluate into memory, and return ν and the power in it."""
        if not at.threads:
            self.check(evaluation.evaluate(self.robot, at.q, *at.vectors.values(), memory), at)
            return memory[ws.NU, : self.nv], memory[ws.POWER, :1]

        def again(t: int) -> None:
            self._fill(at.at(t), np.empty((ws.N_ROWS, max(self.model.nq, 1))))

        self.run_chunks(batch.evaluate_many, (at.q, *at.vectors.values()), memory, at, again, ws.WIDTH)
        return memory.results[ws.NU], memory.numbers[ws.POWER - ws.KINETIC_ENERGY]

    def evaluate(self, at: States, with_tau: bool, loads: Loads, memory: Any, out: results.Evaluation | None) -> Any:
        """Evaluate into memory, of one state or a BatchMemory, which is that of `out` if it is given."""
        model, external, resisting = self.model, None, None
        try:
            # Before memory is written: wrenches may lie in `out`.
            pushing = None if loads.wrenches is None else self.wrench_effort(at, loads)
            nu, power = self._fill(at, memory)
            if pushing is not None:
                external = self._epsilon(at, pushing, "f_ext is")
            if loads.friction:
                resisting = self._epsilon(at, self.friction(at.vectors["qd"]), "friction or qd are")
            results.add_power(nu, power, external, resisting)
            require_finite(at, power, "qd, f_ext or friction are too large: the power overflows")
            if not at.threads:
                rows = memory[:, : self.nv]
                rows[ws.NU_DOT], rows[ws.XI_DOT] = results.rates(rows, external, resisting)
        except BaseException:  # a Ctrl-C, too
            if out is not None:
                results.reusable(out, memory).set_terms(with_tau)
            raise
        if out is not None:
            out.set_terms(with_tau, external, resisting)
        elif at.threads:
            out = results.BatchEvaluation(model, memory, with_tau, external, resisting)
        else:
            out = results.evaluation_of(model, memory, with_tau, external, resisting)
        return out

    # --- Links and contact

    def point_frame(self, q: Array, link: str, point: PointLike, frame: Frame) -> tuple[int, Array, Array]:
        """Return the body of a link, a point of the link in it, and the rotation of its axes to those of `frame`."""
        checks.choice("frame", frame, ("link", "world"))
        offset = checks.numbers("point", point, (3,), "three finite numbers [m]")
        body, placement = self.model.placement_in_body(link)
        in_body = placement[:3, 3] + placement[:3, :3] @ offset
        if frame == "link":
            return body, in_body, placement[:3, :3].T
        X = np.empty((3, 4))
        self.check(kinematics.placement(self.robot, q, body, X), States(q))
        return body, in_body, X[:, :3]

    def motion(self, at: States, link: str, point: PointLike, frame: Frame) -> tuple[Array, Array, Array]:
        """Return twist and its rate at a point of a link, in the body's axes, and the rotation to those of `frame`."""
        body, in_body, rotation = self.point_frame(at.q, link, point, frame)
        found = np.empty((2, 6))
        self.check(kinematics.motion(self.robot, at.q, *at.vectors.values(), body, found), at)
        for V in found:
            V[:3] += np.cross(V[3:], in_body)
        return found[0], found[1], rotation

    def wrench_factor(self, at: States, link: str, wrenches: Array, point: PointLike, frame: Frame) -> Array:
        """Return ℓJᵀw of wrenches, shape (number, 6), at a point of a link, one column each."""
        records = wrenches_at(self.model, link, wrenches, point, frame)
        epsilon = np.empty((self.nv, len(records)))
        self.check(factorization.factor_of_wrenches(self.robot, at.q, records, frame == "world", epsilon), at)
        require_finite(at, epsilon, f"point {list(point)} or the wrench are too large: a result overflows")
        return epsilon

    @cached_property
    def link_frames(self) -> Any:
        """Frames of all links as records for mobilities.mobilities."""
        records = np.zeros(len(self.model.link_names), mobilities.FRAME)
        for k, link in enumerate(self.model.link_names):
            body, X = self.model.placement_in_body(link)
            records[k] = body, np.array_equal(X, np.eye(4)), X[:3, :3].ravel(), X[:3, 3]
        return records

    def contact(self, at: States, points: ContactPoints | Iterable[ContactPoint]) -> Contact:
        """Return contact quantities."""
        model = self.model
        points = points if isinstance(points, ContactPoints) else ContactPoints(model, points)
        names = points.model.link_names, points.model.dof_names
        if points.model is not model and names != (model.link_names, model.dof_names):
            raise InputError(f"points are of robot '{points.model.name}', not of '{model.name}'.")
        inputs = points.table, at.q, at.vectors["qd"]
        outputs = self.empty(at, self.nv), self.empty(at, len(points), contacts.CONTACT_COLUMNS)
        if at.threads:
            self.run_chunks(contacts.contacts_each, inputs, outputs, at, lambda t: self.contact(at.at(t), points))
        else:
            self.check(contacts.contacts(self.robot, *inputs, *outputs), at)
        return Contact(points, *outputs)


_SUM = "tau, f_ext or friction are not finite or too large: their sum is not a finite number"


def require_finite(at: States, values: Array, problem: str) -> None:
    """Raise an error if results are not finite; it names the first of many states."""
    if not np.isfinite(values).all():
        where = f"state {np.argwhere(~np.isfinite(values))[0][0]}: " if at.threads else ""
        raise InputError(f"{where}{problem}.")


def rotate(rotation: Array, V: Array) -> Array:
    """Rotate linear and angular rows."""
    return np.concatenate([rotation @ V[:3], rotation @ V[3:]])


def squared(factor: Array, point: PointLike) -> Any:
    """Return FᵀF of a factor at a point of a link, unless it overflows."""
    with np.errstate(over="ignore", invalid="ignore"):
        square = factor.T @ factor
    if not np.isfinite(square).all():
        raise InputError(f"point {list(point)} is too far away: a result overflows.")
    return square


def raise_failure(model: RobotModel, status: int, work: Any, at: States) -> NoReturn:
    """Raise the error of a sweep's status other than 0; `work` are the records of its workspace."""
    D = float(work["D"][status]) if status > 0 else np.nan
    if np.isfinite(D):
        joint = model.dof_names[model.bodies["dof"][status]]
        raise SingularMassMatrixError(
            f"The mass matrix of robot '{model.name}' is singular at this configuration: joint '{joint}' "
            f"moves no inertia there (D = {D:.3g}, less than {joints.SINGULAR:g} of the inertias that it comes from).",
            joint,
            D,
        )
    checks.check_finite("q", at.q, model.coordinate_names)
    for name, values in at.vectors.items():
        checks.check_finite(name, values, model.dof_names)
    model.integrate(at.q, np.zeros(model.nv))  # raises the error of a quaternion
    raise InputError(f"{', '.join(['q', *at.vectors])} are too large: a result overflows.")
