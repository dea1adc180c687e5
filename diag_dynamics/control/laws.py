# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Control laws in (ν, ε) and their commands.

The laws are damping, gravity compensation, tracking and regulation of joints, and regulation of
poses.

Gains are one number for all degrees of freedom, or one for each. `law.require_stable(q, period)`
raises InputError if a loop of this period [s] would make a gain unstable, and names the largest
gain that is stable.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from typing import NamedTuple, TypeAlias

import numpy as np

from diag_dynamics import rotations
from diag_dynamics.arrays import Array, MatrixLike, VectorLike
from diag_dynamics.checks import choice, instance, numbers, per_name, positive, vector
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import InputError, UnsupportedError

Gain: TypeAlias = VectorLike | float

ORTHOGONAL = 1e-6
"""Maximum deviation of RᵀR of a desired orientation from the identity."""

STABLE = 2.0
"""Product of gain and period below which ṡ = −Ks is stable if its torque lasts for a period."""

ROUND_DOWN = 0.995
"""Factor on the largest gains in texts: three digits of the product are a stable gain, too."""

STIFF = "a finite number > 0 [N m/rad, N/m]"


class PoseError(NamedTuple):
    """Error of a frame's pose in the root link's axes, desired less actual, each of shape (3,)."""

    position: Array  # [m]
    orientation: Array  # rotation vector from the actual to the desired orientation [rad]


class Command(NamedTuple):
    """Joint efforts and their reasons, from one evaluation of a law.

    Arrays have shape (nv,) and are the caller's own. A robot with gravity compensation of its own
    receives τ − g.
    """

    tau: Array  # joint efforts [N m, N], τ = m(ε + ε_g)
    epsilon: Array  # working moments ε that move the robot [J^½/s], without gravity
    gravity_torque: Array  # g(q) [N m, N], the part of tau that holds the robot
    nu: Array  # total joint rates ν [J^½]
    lyapunov: float  # Lyapunov function V of the law [J]
    # dV/dt [W] by the law alone, for a target at rest: without filters, pushes and friction.
    lyapunov_rate: float
    error: Array | PoseError | None = None  # q_d − q of a joint-space target, or that of a pose
    friction: Array | None = None  # working moments in epsilon that friction takes up [J^½/s]


def actuated(dynamics: DiagonalDynamics) -> DiagonalDynamics:
    """Return the dynamics of a robot with a motor at every degree of freedom.

    Raise UnsupportedError for others.
    """
    model = instance("dynamics", dynamics, DiagonalDynamics).model
    if model.floating_base:
        raise UnsupportedError(
            f"robot '{model.name}' has a floating base; expected a motor at each degree of freedom."
        )
    for joint in model.joint_names:
        if joint not in model.dof_names:
            raise UnsupportedError(
                f"joint '{joint}' has several degrees of freedom; expected one with a motor. "
                "Make it fixed."
            )
    return dynamics


class Law(ABC):
    """Control law in (ν, ε) for one robot; subclasses define `require_stable`.

    Use a law in one thread. The constructor compiles all that the law calls.
    It raises UnsupportedError for a floating base or another joint of several degrees of freedom.
    """

    def __init__(self, dynamics: DiagonalDynamics, *methods: str) -> None:
        self.dynamics = actuated(dynamics)
        dynamics.compile("nu_from_qd", "tau_from_epsilon", "gravity_torque", *methods)

    def _command(
        self, q: VectorLike, nu: Array, epsilon: Array, rate: float, stored: float = 0.0
    ) -> Command:
        """Return the command τ = mε + g of working moments; V is K and a stored energy."""
        g = self.dynamics.gravity_torque(q)
        tau = self.dynamics.tau_from_epsilon(q, epsilon)
        tau += g
        return Command(tau, epsilon, g, nu, 0.5 * float(nu @ nu) + stored, rate)

    @abstractmethod
    def require_stable(self, q: VectorLike, period: float) -> None:
        """Raise InputError if a gain is unstable at the positions q [rad, m].

        The loop has a period [s] and no delay.
        """

    def _require_rates(self, name: str, rates: Array, period: float) -> None:
        """Raise InputError if ṡ = −Ks is unstable for the largest of the rates K [1/s]."""
        k = int(np.argmax(rates))
        require_at_most(
            f"{name} of '{self.dynamics.model.dof_names[k]}'",
            rates[k],
            STABLE / period,
            "1/s",
            period,
        )


def require_at_most(name: str, value: float, largest: float, unit: str, period: float) -> None:
    """Raise InputError if a gain exceeds the largest that is stable at a period [s]."""
    if value > largest:
        limit = f"{ROUND_DOWN * largest:.3g} {unit} at {1.0 / period:.4g} Hz"
        raise InputError(f"{name} is {value:.6g}; expected at most {limit}.")


def require_slow(
    root: Array, names: list[str], stiffness: Array, largest: float, period: float
) -> None:
    """Raise InputError unless all modes of springs are slower than a frequency [rad/s].

    The springs are K̃ = root rootᵀ. `names` and `stiffness` are those of the springs, the columns
    of the root. The error names the spring with most of the fastest mode, and the stiffness that it
    has where all are lowered alike.
    """
    _, frequencies, modes = np.linalg.svd(root)
    k = int(np.argmax(np.abs(modes[0])))  # the spring with most of the mode
    bound = stiffness[k] * (largest / frequencies[0]) ** 2
    require_at_most(names[k], stiffness[k], bound, "N m/rad (N/m)", period)


class RateDamping(Law):
    """Rate control ε = −cν (Control 8.1): every total joint rate decays on its own.

    The gain is c > 0 [1/s]. V = K = ½|ν|² and dV/dt = −νᵀcν. With equal gains K decays as
    exp(−2ct), in any configuration and motion.
    """

    def __init__(self, dynamics: DiagonalDynamics, gain: Gain) -> None:
        super().__init__(dynamics)
        self.gain = per_name("gain", gain, dynamics.model.dof_names, "a finite number > 0 [1/s]")

    def command(self, q: VectorLike, qd: VectorLike) -> Command:
        """Return the command at q [rad, m] and qd [rad/s, m/s], each of shape (nv,)."""
        nu = self.dynamics.nu_from_qd(q, qd)
        epsilon = -self.gain * nu
        return self._command(q, nu, epsilon, float(nu @ epsilon))

    def require_stable(self, q: VectorLike, period: float) -> None:
        """Raise InputError unless c·period < 2."""
        self._require_rates("gain", self.gain, period)


class GravityCompensation(Law):
    """Gravity compensation alone, ε = 0: the robot weighs nothing and can be guided by hand.

    V = K = ½|ν|², which only the hand and friction change: dV/dt = 0.
    """

    def command(self, q: VectorLike, qd: VectorLike) -> Command:
        """Return the command at q [rad, m] and qd [rad/s, m/s], each of shape (nv,)."""
        nu = self.dynamics.nu_from_qd(q, qd)
        return self._command(q, nu, 0.0 * nu, 0.0)

    def require_stable(self, q: VectorLike, period: float) -> None:
        """Accept every period: the law has no gain, and ε = 0 feeds nothing back."""


class JointLaw(Law):
    """Law that follows a desired motion of the joints.

    It computes the error and the reference efforts; subclasses define `_respond`.
    """

    def __init__(self, dynamics: DiagonalDynamics, *methods: str) -> None:
        super().__init__(
            dynamics, "inverse_dynamics", "coriolis_matrix_times", "epsilon_from_tau", *methods
        )
        model = dynamics.model
        self._continuous = np.isin(model.dof_names, model.continuous_joints)
        self._zero = np.zeros(model.nv)

    def command(
        self,
        q: VectorLike,
        qd: VectorLike,
        desired_q: VectorLike,
        desired_qd: VectorLike | None = None,
        desired_qdd: VectorLike | None = None,
    ) -> Command:
        """Return the command at q [rad, m] and qd [rad/s, m/s] for a desired motion.

        The derivatives of the motion are 0 by default. All have shape (nv,). The error is q_d − q,
        of a continuous joint the shorter way round.
        """
        names = self.dynamics.model.dof_names
        q = vector("q", q, names)
        qd = vector("qd", qd, names)
        error = vector("desired_q", desired_q, names) - q
        error = np.where(self._continuous, rotations.wrap_angle(error), error)
        qd_d = self._zero if desired_qd is None else vector("desired_qd", desired_qd, names)
        qdd_d = self._zero if desired_qdd is None else vector("desired_qdd", desired_qdd, names)
        return self._respond(q, qd, error, qd_d, qdd_d)

    @abstractmethod
    def _respond(self, q: Array, qd: Array, error: Array, qd_d: Array, qdd_d: Array) -> Command: ...

    def _reference(self, q: Array, qd: Array, qd_r: Array, qdd_r: Array) -> tuple[Array, Array]:
        """Return M q̈_r + C_s q̇_r + g and g [N m, N].

        One Newton–Euler pass with two velocities computes both.
        """
        tau = self.dynamics.inverse_dynamics(q, self._zero, qdd_r)
        tau += self.dynamics.coriolis_matrix_times(q, qd, qd_r)
        return tau, self.dynamics.gravity_torque(q)

    def _closed(
        self,
        q: Array,
        qd: Array,
        reference: tuple[Array, Array],
        s: Array,
        braking: Array,
        error: Array,
        spring: Array,
    ) -> Command:
        """Return the command of m(reference − braking) and springs.

        V = ½|s|² + ½ springᵀerror has the rate dV/dt = −sᵀbraking.
        """
        tau, g = reference
        tau = tau + spring - self.dynamics.tau_from_epsilon(q, braking)
        epsilon = self.dynamics.epsilon_from_tau(q, tau - g)
        V = 0.5 * float(s @ s) + 0.5 * float(spring @ error)
        return Command(
            tau, epsilon, g, self.dynamics.nu_from_qd(q, qd), V, -float(s @ braking), error
        )


class JointTracking(JointLaw):
    """Joint-space tracking in total rates: s = ν − ν_r decays as ṡ = −(K + B)s, with B skew.

    With q̇_r = q̇_d − Λ(q − q_d) and ν_r = mᵀq̇_r the law is ε = ν̇_r + B(q, ν)ν_r − Ks − ρ
    sat(s/φ). B is skew and B ν = C(q, ν), so V = ½|s|² falls at −sᵀ(Ks + ρ sat(s/φ)) in every
    configuration. Once s is zero, q − q_d decays at Λ. ν̇_r + Bν_r is evaluated as ℓ(M q̈_r + C_s
    q̇_r), q̈_r = q̈_d − Λ(q̇ − q̇_d).

    The gain is K > 0 [1/s], the convergence Λ > 0 [1/s]. `closing` is the largest part of q̇_r that
    reduces the error [rad/s, m/s]; inf for none. A larger error is reduced at this rate, and V
    falls as before.

    The bound ρ ≥ 0 [J^½/s] rejects disturbances d = ℓτ_d of an unknown load or friction:
    V̇ ≤ −sᵀKs − Σ(ρ − |d_k|)|s_k| for |s_k| ≥ φ. The width φ > 0 [J^½] of this boundary layer makes
    it a gain ρ/φ near s = 0.
    """

    def __init__(
        self,
        dynamics: DiagonalDynamics,
        gain: Gain,
        convergence: Gain,
        closing: Gain = np.inf,
        *,
        bound: Gain = 0.0,
        width: float = 0.3,
    ) -> None:
        super().__init__(dynamics)
        names = dynamics.model.dof_names
        self.gain = per_name("gain", gain, names, "a finite number > 0 [1/s]")
        self.convergence = per_name("convergence", convergence, names, "a finite number > 0 [1/s]")
        self.closing = per_name(
            "closing", closing, names, "a number > 0 [rad/s, m/s]", lambda x: x > 0.0
        )
        self.bound = per_name(
            "bound", bound, names, "a finite number >= 0 [J^½/s]", lambda x: 0.0 <= x < np.inf
        )
        self.width = positive("width", width, "[J^½]")

    def _respond(self, q: Array, qd: Array, error: Array, qd_d: Array, qdd_d: Array) -> Command:
        closing = self.convergence * error
        bounded = np.clip(closing, -self.closing, self.closing)
        qd_r = qd_d + bounded
        qdd_r = qdd_d + np.where(bounded == closing, self.convergence, 0.0) * (qd_d - qd)
        s = self.dynamics.nu_from_qd(q, qd - qd_r)
        braking = self.gain * s + self.bound * np.clip(s / self.width, -1.0, 1.0)
        return self._closed(
            q, qd, self._reference(q, qd, qd_r, qdd_r), s, braking, error, self._zero
        )

    def require_stable(self, q: VectorLike, period: float) -> None:
        """Raise InputError unless (K + ρ/φ + Λ)·period < 2, with the largest Λ."""
        rates = self.gain + self.bound / self.width + self.convergence.max()
        self._require_rates("gain + bound/width + convergence", rates, period)


class JointRegulation(JointLaw):
    """Joint springs with one damping ratio ζ.

    The command is τ = M q̈_d + C_s q̇_d + g + K_q(q_d − q) − m c s, with s = ν − mᵀq̇_d.

    With K̃ = ℓK_qℓᵀ and c = 2ζK̃^½ (symmetric root) the motion about a set-point is
    z̈ + 2ζK̃^½ż + K̃z = 0: every mode has the damping ratio ζ in every configuration.
    V = ½|s|² + ½(q_d − q)ᵀK_q(q_d − q) falls at −sᵀcs.

    The stiffness is K_q > 0 [N m/rad, N/m], the damping ratio ζ > 0; 1 is critical. The attribute
    `stiffness`, a positive definite matrix of shape (nv, nv), may be set between commands.

    Example
    -------
    >>> import diag_dynamics as dd
    >>> dyn = dd.DiagonalDynamics(dd.load_robot("ur5"))
    >>> law = dd.JointRegulation(dyn, stiffness=200.0, damping_ratio=0.7)
    >>> command = law.command([0, -1, 1, 0, 0, 0], [0] * 6, desired_q=[0, -1, 1.2, 0, 0, 0])
    >>> round(command.lyapunov, 9)  # ½ 200 N m/rad (0.2 rad)²
    4.0
    """

    def __init__(self, dynamics: DiagonalDynamics, stiffness: Gain, damping_ratio: float) -> None:
        super().__init__(dynamics, "factors")
        self.stiffness = np.diag(per_name("stiffness", stiffness, dynamics.model.dof_names, STIFF))
        self.damping_ratio = positive("damping_ratio", damping_ratio, "[1]")

    @property
    def stiffness(self) -> Array:
        """Stiffness K_q [N m/rad, N/m], shape (nv, nv)."""
        return self._stiffness

    @stiffness.setter
    def stiffness(self, matrix: MatrixLike) -> None:
        self._stiffness = positive_definite("stiffness", matrix, self.dynamics.model.nv)
        values, axes = np.linalg.eigh(self._stiffness)
        self._root = (axes * np.sqrt(values)) @ axes.T

    def _respond(self, q: Array, qd: Array, error: Array, qd_d: Array, qdd_d: Array) -> Command:
        s = self.dynamics.nu_from_qd(q, qd - qd_d)
        root = self.dynamics.factors(q).l @ self._root
        braking = modal_damping(root, s, self.damping_ratio)
        return self._closed(
            q, qd, self._reference(q, qd, qd_d, qdd_d), s, braking, error, self._stiffness @ error
        )

    def require_stable(self, q: VectorLike, period: float) -> None:
        """Raise InputError unless the fastest mode at q has ω·period < min(4ζ, 1/ζ)."""
        root = self.dynamics.factors(q).l @ self._root
        names = [f"stiffness of '{name}'" for name in self.dynamics.model.dof_names]
        largest = largest_frequency(self.damping_ratio, period)
        require_slow(root, names, np.diag(self._stiffness), largest, period)


def positive_definite(name: str, value: MatrixLike, size: int) -> Array:
    """Return a symmetric and positive definite matrix of shape (size, size)."""
    expected = f"{size} x {size} finite numbers, symmetric and positive definite"
    matrix = numbers(name, value, (size, size), expected)
    if not np.allclose(matrix, matrix.T) or np.linalg.eigvalsh(matrix)[0] <= 0.0:
        raise InputError(f"{name} is {matrix.tolist()}; expected {expected}.")
    return matrix


def modal_damping(root: Array, nu: Array, ratio: float, least: float = 0.0) -> Array:
    """Return 2ζK̃^½ν [J^½/s] of a stiffness K̃ = root rootᵀ, shape (nv, k).

    Modes below the frequency `least` [rad/s], such as those without stiffness, are damped like a
    mode of that frequency.
    """
    U, frequencies, _ = np.linalg.svd(root)
    rates = np.full(len(nu), least)
    np.maximum(frequencies, least, out=rates[: len(frequencies)])
    damped: Array = U @ ((2.0 * ratio) * rates * (nu @ U))
    return damped


def largest_frequency(ratio: float, period: float) -> float:
    """Return the frequency [rad/s] below which springs of a damping ratio are stable.

    Their torques last for a period.
    """
    return min(4.0 * ratio, 1.0 / ratio) / period


class PoseRegulation(Law):
    """Pose regulation ε = −c₁ν + ℓJᵀC₂e: springs pull a frame to its target.

    This is Control 8.2 with the sign that converges.

    e = Y_d − Y(q), Y the frame's position and its three axes a_j, and JᵀC₂e = J₆ᵀ[c_p; Σ a_j × c_j]
    with c = C₂e, a wrench at the frame. V = ½|ν|² + ½eᵀC₂e falls at −νᵀc₁ν, which includes the null
    space of a redundant arm. The robot comes to rest where ℓJᵀC₂e = 0: at the target; at a
    singularity or a target out of reach; and at an orientation error of exactly 180°, if its
    stiffness is the same about all axes.

    The frame has the link's axes and its origin at a point [m] in these. The position stiffness is
    C₂ > 0 [N/m], one number or one for each of the root link's axes. The orientation stiffness > 0
    [N m/rad] against small rotations is twice the weight C₂ of an axis.

    Either the damping c₁ > 0 [1/s] is constant, or a damping ratio ζ > 0 is the same for all modes
    and configurations: c₁ = 2ζK̃^½ with K̃ = ℓJᵀK_xJℓᵀ, as of :class:`JointRegulation`. Motion in
    the null space of K̃ is then damped by 2ζω, ω the `null_frequency` > 0 [rad/s]; slower modes
    are, too, so that c₁ is continuous at singularities.
    """

    def __init__(
        self,
        dynamics: DiagonalDynamics,
        link: str,
        damping: Gain | None = None,
        position_stiffness: Gain = 200.0,
        orientation_stiffness: float = 20.0,
        point: VectorLike = (0.0, 0.0, 0.0),
        *,
        damping_ratio: float | None = None,
        null_frequency: float = 1.0,
    ) -> None:
        super().__init__(dynamics, "placement", "wrench_factor")
        choice("link", link, dynamics.model.link_names)
        if (damping is None) == (damping_ratio is None):
            raise InputError(
                f"damping is {damping} and damping_ratio is {damping_ratio}; expected one of them."
            )
        self.link = link
        self.damping: Array | None = None
        self.damping_ratio = 0.0
        if damping is not None:
            self.damping = per_name(
                "damping", damping, dynamics.model.dof_names, "a finite number > 0 [1/s]"
            )
        else:
            self.damping_ratio = positive("damping_ratio", damping_ratio, "[1]")
        self.null_frequency = positive("null_frequency", null_frequency, "[rad/s]")
        self.position_stiffness = per_name(
            "position_stiffness", position_stiffness, "xyz", "a finite number > 0 [N/m]"
        )
        self.orientation_stiffness = positive(
            "orientation_stiffness", orientation_stiffness, "[N m/rad]"
        )
        self.point = numbers("point", point, (3,), "three finite numbers [m]")
        self._root = np.sqrt([*self.position_stiffness, *3 * [self.orientation_stiffness]])
        self._target: tuple[Array, Array] | None = None

    def aim(self, position: VectorLike, orientation: MatrixLike) -> None:
        """Set the target in the root link's axes, which a command requires.

        The position [m] is from the root link's origin, shape (3,). The orientation is a rotation
        matrix, with the frame's axes as columns.
        """
        position = numbers("position", position, (3,), "three finite numbers [m]")
        R = numbers("orientation", orientation, (3, 3), "a rotation matrix")
        if np.abs(R.T @ R - np.eye(3)).max() > ORTHOGONAL or np.linalg.det(R) < 0.0:
            raise InputError(f"orientation is {R.tolist()}; expected a rotation matrix.")
        self._target = position, R

    def pose(self, q: VectorLike) -> tuple[Array, Array]:
        """Return the frame's position [m], shape (3,), and axes as columns, shape (3, 3), at q.

        They are in the root link's axes.
        """
        X = self.dynamics.placement(q, self.link)
        return X[:3, :3] @ self.point + X[:3, 3], X[:3, :3]

    def command(self, q: VectorLike, qd: VectorLike) -> Command:
        """Return the command towards the target.

        Both q [rad, m] and qd [rad/s, m/s] have shape (nv,).
        """
        if self._target is None:
            raise InputError("PoseRegulation has no target; expected one. Call aim first.")
        nu = self.dynamics.nu_from_qd(q, qd)
        position, axes = self.pose(q)
        distance = self._target[0] - position
        R = self._target[1] @ axes.T
        weight = 0.5 * self.orientation_stiffness
        force = self.position_stiffness * distance
        moment = weight * rotations.vee(R)  # Σ a_j × (a_dj − a_j)
        # ½ Σ |a_dj − a_j|² is 3 − tr R
        stored = 0.5 * float(force @ distance) + weight * (3.0 - float(np.trace(R)))
        factor = self.dynamics.wrench_factor(q, self.link, self.point, "world")
        if self.damping is not None:
            damped = self.damping * nu
        else:
            damped = modal_damping(factor * self._root, nu, self.damping_ratio, self.null_frequency)
        epsilon = factor @ np.concatenate([force, moment]) - damped
        command = self._command(q, nu, epsilon, -float(nu @ damped), stored)
        return command._replace(error=PoseError(distance, rotations.to_vector(R)))

    def require_stable(self, q: VectorLike, period: float) -> None:
        """Raise InputError for unstable gains.

        Every mode requires c₁·period < 2 and ω²·period < 2c₁; with a damping ratio, ω·period <
        min(4ζ, 1/ζ).
        """
        root = self.dynamics.wrench_factor(q, self.link, self.point, "world") * self._root
        if self.damping is None:
            largest = largest_frequency(self.damping_ratio, period)
        else:
            self._require_rates("damping", self.damping, period)
            root = root / np.sqrt(self.damping)[:, None]
            largest = math.sqrt(STABLE / period)
        names = [f"position_stiffness of '{axis}'" for axis in "xyz"]
        names += 3 * ["orientation_stiffness"]
        require_slow(root, names, self._root**2, largest, period)
