# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Sweeps over one robot: the kernel of each quantity, its call at one state or many, its errors."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from functools import cached_property, partial
from typing import Any, NamedTuple, NoReturn

import numpy as np

from diag_dynamics import checks, results, threads
from diag_dynamics.arrays import Array, Frame, PointLike
from diag_dynamics.collision.contact_points import ContactPoint, ContactPoints
from diag_dynamics.collision.predicted_contact import PredictedContact
from diag_dynamics.description.checks import warn
from diag_dynamics.dynamics import external_wrench
from diag_dynamics.dynamics.arguments import Loads, States
from diag_dynamics.dynamics.external_wrench import PointOfWrench
from diag_dynamics.exceptions import InputError, LoopError, LoopWarning, SingularMassMatrixError
from diag_dynamics.model import RobotModel
from diag_dynamics.model.followers import FollowerMotion, FollowerState, loop_error, loop_title
from diag_dynamics.model.links import point_in_body, wrenches_at, wrenches_on_links
from diag_dynamics.model.massless import joint_inertias
from diag_dynamics.numerics.callback import FAILED
from diag_dynamics.numerics.tables import Addresses
from diag_dynamics.sweeps import (
    batch,
    classical,
    contacts,
    couplings,
    evaluation,
    external,
    factorization,
    joints,
    kinematics,
    mobilities,
    regressors,
)
from diag_dynamics.sweeps import workspace as ws


class VectorSweep(NamedTuple):
    """A sweep whose result is a vector: its kernel, and its number in batch.sweep_each."""

    single: Any
    number: int
    option: tuple[float, ...] = ()
    """Weight of gravity in inverse dynamics, or number of a transformation."""
    vectors: int = 1
    """Vectors in the result, one after another; 0 if it is a point in space."""


FORWARD_DYNAMICS = VectorSweep(classical.forward_dynamics, batch.FORWARD)
INVERSE_DYNAMICS = VectorSweep(classical.inverse_dynamics, batch.INVERSE, (1.0,))
WITHOUT_GRAVITY = VectorSweep(classical.inverse_dynamics, batch.INVERSE, (0.0,))
MOMENTUM = VectorSweep(classical.momentum, batch.MOMENTUM, vectors=2)
FIRST_MOMENT = VectorSweep(classical.first_moment, batch.FIRST_MOMENT, vectors=0)
NU_FROM_QD, QD_FROM_NU, EPSILON_FROM_TAU, TAU_FROM_EPSILON = (
    VectorSweep(factorization.transform, batch.TRANSFORM, (number,)) for number in range(4)
)


class SweepCaller:
    """A robot with memory for its sweeps. Arguments are checked :class:`States`."""

    def __init__(self, model: RobotModel) -> None:
        self.model = model
        self.nv = model.nv
        self.shape = ws.N_ROWS, max(model.nq, 1)  # numbers need an entry even without joints
        self._workspace = model.new_workspace()
        self.robot = self._workspace.robot
        self._workspaces = threads.Workspaces(model)
        self._zeros = np.zeros((1, model.nv))
        friction = model.friction, model.load_friction, model.root_friction
        self._has_friction, self._depends_on_load, self._has_roots = (
            bool(values.any()) for values in friction
        )
        self._followers = FollowerMotion(model) if model.has_follower_friction else None
        self._ratios = self._workspace.couplings.ratio if model.loops else np.zeros(0)

    # --- Calls

    def vector(self, sweep: VectorSweep, at: States, problem: str = "") -> Array:
        """Return the vector of a sweep; `problem` is its error, by default that of an argument."""
        length = sweep.vectors * self.nv if sweep.vectors else 3
        result = self._empty(at, length)
        vectors = at.vectors.values()
        if at.threads:
            A, B = (*vectors, self._zeros, self._zeros)[:2]
            inputs = sweep.number, at.q, A, B, sum(sweep.option)
            single = partial(self.vector, sweep, problem=problem)
            self._call_many(batch.sweep_each, inputs, (result,), at, single)
        else:
            status = sweep.single(self.robot, at.q, *vectors, *sweep.option, result)
            self.check(status, at, problem)
        return result

    def _empty(self, at: States, *shape: int) -> Array:
        """Return uninitialized memory of a shape for each state."""
        return np.empty((*at.q.shape[:-1], *shape))

    def _call_many(
        self,
        kernel: Callable[..., int],
        inputs: Iterable[Any],
        outputs: Iterable[Any],
        at: States,
        single: Callable[[States], Any],
        width: int = 1,
    ) -> None:
        """Call a kernel at many states in threads.

        `single` calls it at one of `width` states that failed together, to raise its error.
        """

        def sweep(robot: int, first: int, last: int) -> int:
            return kernel(robot, *inputs, first, last, *outputs)

        failing = threads.run_chunks(self._workspaces, len(at.q), sweep, at.threads, width)
        for t in failing:
            try:
                single(at.at(t))
            except SingularMassMatrixError as error:
                message = f"state {t}: {error}"
                D = error.articulated_inertia
                raise SingularMassMatrixError(message, error.joint, D) from None
            except (InputError, LoopError) as error:
                raise type(error)(f"state {t}: {error}") from None
        if failing:
            where = f"states {failing[0]} to {failing[-1]}"
            raise InputError(f"arguments have changed while {where} were evaluated.")

    def _call(
        self,
        single_kernel: Any,
        batch_kernel: Any,
        inputs: Any,
        outputs: Any,
        at: States,
        single: Any,
    ) -> None:
        """Call the kernel of one state, or that of many as :meth:`_call_many` does."""
        if at.threads:
            self._call_many(batch_kernel, inputs, outputs, at, single)
        else:
            self.check(single_kernel(self.robot, *inputs, *outputs), at)

    def check(self, status: int, at: States, problem: str = "") -> None:
        """Raise the error of a kernel's status at one state, if there is one."""
        if not status:
            self.warn_of_loops()
            return
        if problem and status > couplings.OPEN_LOOP:
            raise InputError(f"{problem}.")
        D = np.nan
        if status > 0:  # in new memory: another thread may have used the shared one since
            workspace = self.model.new_workspace() if self.model.followers else None
            inertias, _ = joint_inertias(self.model, at.q, workspace)
            D = inertias[self.model.bodies["dof"][status]]
        raise_failure(self.model, status, D, at)

    def warn_of_loops(self) -> None:
        """Warn once that a loop is nearly singular at the last state."""
        if not len(self._ratios) or min(self._ratios.tolist()) >= couplings.NEARLY_SINGULAR:
            return
        number = int(np.argmin(self._ratios))
        title = loop_title(self.model, number)
        ratio = self._ratios[number]
        warn(
            f"{title} of robot '{self.model.name}' is nearly singular for its independent joints, "
            f"by {ratio:.1g}.",
            LoopWarning,
        )
        self._ratios = np.zeros(0)

    # --- Joint space

    def mass_matrix(self, at: States) -> Array:
        """Return M."""
        M = self._empty(at, self.nv, self.nv)
        self._call(
            classical.mass_matrix, batch.mass_matrix_each, (at.q,), (M,), at, self.mass_matrix
        )
        return M

    def factors(self, at: States) -> tuple[Array, Array]:
        """Return m, ℓ and the unit factor, shape (3, …, nv, nv), and D."""
        nv = self.nv
        D = self._empty(at, self.nv)
        factors = self._empty(at, 3, nv, nv)
        blocks = factors.reshape(3 * math.prod(D.shape[:-1]), nv, nv)
        kernels = factorization.factors, batch.factors_each
        self._call(*kernels, (at.q,), (blocks, D), at, self.factors)
        return np.moveaxis(factors, -3, 0), D

    def regressor(self, at: States) -> Array:
        """Return Y of the parameters of all links."""
        frames = self.link_frames
        Y = self._empty(at, self.nv, regressors.PARAMETERS * len(frames))
        inputs = at.q, *at.vectors.values(), frames
        kernels = regressors.regressor, batch.regressor_each
        self._call(*kernels, inputs, (Y,), at, self.regressor)
        return Y

    def forward_dynamics(self, at: States, loads: Loads) -> Array:
        """Return q̈ with wrenches and friction."""
        qd = at.vectors["qd"]
        tau = at.vectors["tau"]
        if loads.friction or loads.wrenches is not None:
            for name, x in at.vectors.items():
                checks.check_finite(name, x, self.model.dof_names)
            if loads.friction:
                tau = tau - self.friction(at)
            if loads.wrenches is not None:
                tau = tau + self._wrench_effort(at, loads)
            _require_finite(at, tau, _SUM)
        return self.vector(FORWARD_DYNAMICS, at._replace(vectors={"qd": qd, "tau": tau}))

    def inverse_dynamics(self, at: States, loads: Loads) -> Array:
        """Return τ with wrenches and friction."""
        tau = self.vector(INVERSE_DYNAMICS, at)
        if loads.friction:
            tau += self.friction(at)
        if loads.wrenches is not None:
            tau -= self._wrench_effort(at, loads)
        _require_finite(at, tau, _SUM)
        return tau

    def _wrench_effort(self, at: States, loads: Loads) -> Array:
        """Return Jᵀf_ext."""
        f_ext = loads.wrenches
        frame = loads.frame
        tau = self._empty(at, self.nv)
        in_world = frame == "world"
        if at.threads:
            records = wrenches_on_links(self.model, f_ext, frame, len(at.q))
            inputs = at.q, records, len(f_ext), in_world
            # Only q can be wrong, and any sweep names its error.
            self._call_many(batch.effort_of_wrenches_each, inputs, (tau,), at, self.mass_matrix)
        else:
            records = wrenches_on_links(self.model, f_ext, frame)
            status = classical.effort_of_wrenches(self.robot, at.q, records, in_world, tau)
            self.check(status, States(at.q))
        return tau

    def friction(self, at: States) -> Array:
        """Return the friction that resists rates, shape (…, nv); q is for load and followers."""
        model = self.model
        qd = at.vectors["qd"]
        checks.check_finite("qd", qd, model.dof_names)
        v0 = model.friction_velocity
        resisting = model.damping * qd + model.effort_offset
        if self._has_roots:
            resisting += model.root_friction * root_of_rate(qd, v0)
        if self._depends_on_load or self._has_friction:
            load = np.abs(self.gravity_torque(at)) if self._depends_on_load else 0.0
            resisting += (model.friction + model.load_friction * load) * direction(qd, v0)
        if self._followers:
            rows = zip(at.q.reshape(-1, model.nq), qd.reshape(-1, model.nv), strict=True)
            resisting += np.reshape(
                [self._friction_of_followers(self._followers.at(*row), row[1]) for row in rows],
                qd.shape,
            )
        return resisting

    def _friction_of_followers(self, now: FollowerState, qd: Array) -> Array:
        """Return Gᵀ of the friction of followers with changing ratios at one state."""
        model = self.model
        G = now.ratios[len(model.mimics) :]
        v0 = model.friction_velocity
        rate = G @ qd
        coulomb = model.follower_friction * direction(rate, v0)
        friction: Array = (model.follower_damping * rate + coulomb) @ G
        return friction

    def gravity_torque(self, at: States) -> Array:
        """Return g(q)."""
        zeros = self._zeros if at.threads else self._zeros[0]
        return self.vector(INVERSE_DYNAMICS, at._replace(vectors={"qd": zeros, "qdd": zeros}))

    # --- Evaluation

    def evaluate(self, at: States, with_tau: bool, loads: Loads) -> results.Evaluation:
        """Return the evaluation of one state or many."""
        if at.threads:
            batch = results.BatchMemory.allocate(self.model, len(at.q))
            terms = self._evaluate_terms(at, loads, batch)
            return results.BatchEvaluation(self.model, batch, with_tau, *terms)
        state = np.empty(self.shape)
        terms = self._evaluate_terms(at, loads, state)
        return results.evaluation_of(self.model, state, with_tau, *terms)

    def _evaluate_terms(
        self, at: States, loads: Loads, memory: Any
    ) -> tuple[results.Term, results.Term]:
        """Evaluate into memory; return ε of wrenches and of friction, None without them."""
        external = friction = None
        nu, power = self._fill(at, memory)
        if loads.wrenches is not None:
            effort = self._wrench_effort(at, loads)
            external = self._epsilon(at, effort, "f_ext is too large")
        if loads.friction:
            resisting = self.friction(at)
            friction = self._epsilon(at, resisting, "friction or qd are too large")
        results.add_power(nu, power, external, friction)
        _require_finite(at, power, "qd, f_ext or friction are too large: the power overflows")
        if not at.threads:
            rows = memory[:, : self.nv]
            rows[ws.NU_DOT], rows[ws.XI_DOT] = results.rates(rows, external, friction)
        return external, friction

    def _fill(self, at: States, memory: Any) -> tuple[Array, Array]:
        """Evaluate without wrenches and friction; return ν and the power in memory."""
        inputs = at.q, *at.vectors.values()
        if not at.threads:
            self.check(evaluation.evaluate(self.robot, *inputs, memory), at)
            return memory[ws.NU, : self.nv], memory[ws.POWER, :1]
        single = partial(self._fill, memory=np.empty(self.shape))
        self._call_many(batch.evaluate_many, inputs, memory, at, single, ws.WIDTH)
        return memory.results[ws.NU], memory.numbers[ws.POWER - ws.KINETIC_ENERGY]

    def _epsilon(self, at: States, tau: Array, problem: str) -> Array:
        """Return ε = ℓτ, read-only."""
        at = at._replace(vectors={"tau": tau})
        problem = f"{problem}: a result overflows"
        return results.read_only(self.vector(EPSILON_FROM_TAU, at, problem))

    # --- Links and contact

    def point_frame(
        self, q: Array, link: str, point: PointLike, frame: Frame
    ) -> tuple[int, Array, Array]:
        """Return a link's body, a point in its axes, and their rotation to the axes of `frame`."""
        body, rotation, in_body = point_in_body(self.model, link, point, frame)
        X = np.empty((3, 4))
        self.check(kinematics.placement(self.robot, q, body, X), States(q))
        return body, in_body, rotation.T if frame == "link" else X[:, :3]

    def motion(
        self, at: States, link: str, point: PointLike, frame: Frame
    ) -> tuple[Array, Array, Array]:
        """Return the twist of a point and its rate in the body's axes, and their rotation."""
        body, in_body, rotation = self.point_frame(at.q, link, point, frame)
        V, V_rate = motions = np.empty((2, 6))
        self.check(kinematics.motion(self.robot, at.q, *at.vectors.values(), body, motions), at)
        V[:3] += np.cross(V[3:], in_body)
        V_rate[:3] += np.cross(V_rate[3:], in_body)
        return V, V_rate, rotation

    def wrench_factor(
        self, at: States, link: str, wrenches: Array, point: PointLike, frame: Frame
    ) -> Array:
        """Return ℓJᵀw of wrenches, shape (number, 6), at a point of a link, one column each."""
        records = wrenches_at(self.model, link, wrenches, point, frame)
        in_world = frame == "world"
        epsilon = np.empty((self.nv, len(records)))
        status = factorization.factor_of_wrenches(self.robot, at.q, records, in_world, epsilon)
        self.check(status, at)
        problem = f"point {list(point)} or the wrench are too large: a result overflows"
        _require_finite(at, epsilon, problem)
        return epsilon

    @cached_property
    def link_frames(self) -> Any:
        """Frames of all links as records for mobilities.mobilities."""
        records = np.zeros(len(self.model.link_names), mobilities.FRAME)
        for k, link in enumerate(self.model.link_names):
            body, X = self.model.placement_in_body(link)
            records[k] = body, X[:3, :3].ravel(), X[:3, 3]
        return records

    def wrench(self, at: States, point: PointOfWrench) -> results.ExternalWrench:
        """Return the external wrench at a point of :func:`external_wrench.point_of_wrench`."""
        torque = at.vectors["external_torque"]
        if at.threads:
            wrenches = results.ExternalWrench.allocate(len(at.q))
            inputs = (point, at.q, torque)
            single = partial(self.wrench, point=point)
            self._call_many(external_wrench.estimate_each, inputs, wrenches, at, single)
            return wrenches.as_read_only()
        wrenches = external_wrench.estimate(self.robot, point, at.q[None], torque[None])
        status = 0
        if not len(wrenches.wrench):
            status = kinematics.placement(self.robot, at.q, point.body, np.empty((3, 4))) or -1
        self.check(status, at)
        return results.ExternalWrench(*(rows[0] for rows in wrenches.as_read_only()))

    def touched_link(
        self, at: States, links: tuple[str, ...], table: Addresses
    ) -> results.TouchedLink:
        """Return the touched link of a table of :func:`noise.candidates`."""
        rows = self._empty(at, 1 + len(links))
        inputs = table.at, at.q, at.vectors["external_torque"]
        single = partial(self.touched_link, links=links, table=table)
        self._call(external.touched_link, external.touched_link_each, inputs, (rows,), at, single)
        return results.TouchedLink.of_rows(links, rows)

    def contact_limits(
        self, at: States, points: ContactPoints | Iterable[ContactPoint]
    ) -> PredictedContact:
        """Return contact quantities."""
        model = self.model
        points = points if isinstance(points, ContactPoints) else ContactPoints(model, points)
        names = points.model.link_names, points.model.dof_names
        if points.model is not model and names != (model.link_names, model.dof_names):
            raise InputError(f"points are of robot '{points.model.name}', not of '{model.name}'.")
        inputs = points.table, at.q, at.vectors["qd"]
        outputs = self._empty(at, self.nv), self._empty(at, len(points), contacts.CONTACT_COLUMNS)
        self._call(
            contacts.contacts,
            contacts.contacts_each,
            inputs,
            outputs,
            at,
            partial(self.contact_limits, points=points),
        )
        return PredictedContact(points, *outputs)


def direction(qd: Array, v0: float) -> Array:
    """Return tanh(q̇/v₀), the sign of q̇ if v₀ is 0."""
    with np.errstate(over="ignore"):
        return np.tanh(qd / v0) if v0 else np.sign(qd)


def root_of_rate(qd: Array, v0: float) -> Array:
    """Return q̇/√max(|q̇|, v₀): √|q̇| sign q̇, and a straight line through 0 within ±v₀."""
    return qd / np.sqrt(np.maximum(np.abs(qd), max(v0, np.finfo(float).tiny)))


def rotate(rotation: Array, V: Array) -> Array:
    """Return linear and angular rows in other axes."""
    return np.concatenate([rotation @ V[:3], rotation @ V[3:]])


def square(factor: Array, point: PointLike) -> Any:
    """Return FᵀF of a factor ℓJᵀ at a point of a link, unless it overflows."""
    with np.errstate(over="ignore", invalid="ignore"):
        product = factor.T @ factor
    if not np.isfinite(product).all():
        raise InputError(f"point {list(point)} is too far away: a result overflows.")
    return product


# --- Errors

_SUM = "tau, f_ext or friction are not finite or too large: their sum is not a finite number"


def _require_finite(at: States, values: Array, problem: str) -> None:
    """Raise an error if results are not finite; it names the first of many states."""
    if not np.isfinite(values).all():
        where = f"state {np.argwhere(~np.isfinite(values))[0][0]}: " if at.threads else ""
        raise InputError(f"{where}{problem}.")


def raise_failure(model: RobotModel, status: int, D: float, at: States) -> NoReturn:
    """Raise the error of a kernel's status other than 0; D is of a singular joint, or NaN."""
    if status == FAILED:
        raise RuntimeError("a step of the sweep could not be compiled; see the error above.")
    if np.isfinite(D):
        joint = model.dof_names[model.bodies["dof"][status]]
        raise SingularMassMatrixError(
            f"The mass matrix of robot '{model.name}' is singular at this configuration: "
            f"joint '{joint}' moves no inertia there (D = {D:.3g}, less than "
            f"{joints.SINGULAR:g} of the inertias that it comes from).",
            joint,
            D,
        )
    checks.check_finite("q", at.q, model.coordinate_names)
    if status <= couplings.OPEN_LOOP:
        raise loop_error(model, status)
    for name, values in at.vectors.items():
        checks.check_finite(name, values, model.dof_names)
    model.integrate(at.q, np.zeros(model.nv))  # raises the error of a quaternion
    raise InputError(f"{', '.join(['q', *at.vectors])} are too large: a result overflows.")
