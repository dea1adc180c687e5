"""A robot moving under its own dynamics: fixed steps of the diagonalized equations (Algorithm 8.1), compiled.

The state is (q, ν) and its equations ν̇ = ε − C − ε_g − ε_d, q̇ = ℓᵀν, with ε_d = ℓ d q̇ the joint damping.
Damping over D reaches 10⁶ s⁻¹ on the small links of a hand, far beyond what an explicit step of a millisecond
bears, so it is taken implicitly: at a stage with step fraction hγ it costs one solve with (M + hγ d), which is the
same O(N) recursion with hγ d added to the armature. The rest is explicit. Without damping the method is the
explicit Runge–Kutta method of the pair.

The pair is ARK4(3)6L[2]SA of Kennedy and Carpenter (Applied Numerical Mathematics 44, 2003): order 4, its implicit
part L-stable and stiffly accurate, so that a heavily damped joint creeps at the speed τ/d that it should.

Order 1 is there for speed: semi-implicit Euler on (q, q̇), as most simulators have it, damping implicit here too. A step
costs one forward dynamics, which adds hd to the armature.

Position limits are hard stops without rebound. A joint that arrives at its limit is held there by an impulse, which
is the projection that takes the least kinetic energy away and never adds any.
"""

import math

import numpy as np

from diag_dynamics import sweeps
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import InputError, UnsupportedError
from diag_dynamics.kernel import COUNT, MATRIX, NUMBER, ROBOT, VECTOR, entry_kernel, large_kernel
from diag_dynamics.results import Evaluation

STAGES = 6
GAMMA = 0.25

EXPLICIT = np.zeros((STAGES, STAGES))
EXPLICIT[1, :1] = [1 / 2]
EXPLICIT[2, :2] = [13861 / 62500, 6889 / 62500]
EXPLICIT[3, :3] = [
    -116923316275 / 2393684061468,
    -2731218467317 / 15368042101831,
    9408046702089 / 11113171139209,
]
EXPLICIT[4, :4] = [
    -451086348788 / 2902428689909,
    -2682348792572 / 7519795681897,
    12662868775082 / 11960479115383,
    3355817975965 / 11060851509271,
]
EXPLICIT[5, :5] = [
    647845179188 / 3216320057751,
    73281519250 / 8382639484533,
    552539513391 / 3454668386233,
    3354512671639 / 8306763924573,
    4040 / 17871,
]

WEIGHTS = np.array([82889 / 524892, 0.0, 15625 / 83664, 69875 / 102672, -2260 / 8211, 1 / 4])

IMPLICIT = np.zeros((STAGES, STAGES))
IMPLICIT[1, :2] = [1 / 4, GAMMA]
IMPLICIT[2, :3] = [8611 / 62500, -1743 / 31250, GAMMA]
IMPLICIT[3, :4] = [5012029 / 34652500, -654441 / 2922500, 174375 / 388108, GAMMA]
IMPLICIT[4, :5] = [
    15267082809 / 155376265600,
    -71443401 / 120774400,
    730878875 / 902184768,
    2285395 / 8070912,
    GAMMA,
]
IMPLICIT[5] = WEIGHTS

for _table in (EXPLICIT, IMPLICIT, WEIGHTS):
    _table.flags.writeable = False


class Simulation:
    """A robot, its state and the effort on its joints, advanced in fixed steps.

    Parameters
    ----------
    model : RobotModel
    q, qd : array_like, shape (nv,), optional
        Initial positions [rad, m] and rates [rad/s, m/s]. By default at rest, at zero or, where that is outside the
        limits, in the middle of them.
    step : float
        Step size h [s].
    damping : array_like, shape (nv,), optional
        Joint damping d [N m s/rad, N s/m], by default that of the URDF.
    limits : bool
        Whether position limits are hard stops.
    order : {4, 1}
        Order of the error in the step: 4, or 1 for steps at a tenth of the cost.

    Attributes
    ----------
    time : float
        Simulated time [s].
    damping : ndarray, shape (nv,)
        Joint damping in force.

    Raises
    ------
    InputError
        A value is out of range.
    """

    def __init__(self, model, q=None, qd=None, step=1e-3, damping=None, limits=True, order=4):
        self.model = model
        self.dynamics = DiagonalDynamics(model)
        if any(body["dofs"] > 1 for body in model.bodies[1:]):
            raise UnsupportedError(
                f"robot '{model.name}' has a joint of several degrees of freedom, which the simulation does not offer yet."
            )
        if not (isinstance(step, (int, float)) and np.isfinite(step) and step > 0.0):
            raise InputError(f"step is {step!r} s, expected a finite number > 0.")
        if order not in (1, 4):
            raise InputError(f"order is {order!r}, expected 4 or 1.")
        self.step_size, self._order = float(step), int(order)
        self.damping = model.damping if damping is None else damping
        unlimited = np.full(model.nv, np.inf)
        self._lower, self._upper = (model.lower.copy(), model.upper.copy()) if limits else (-unlimited, unlimited)
        self._workspace = sweeps.Workspace(model.bodies, model.gravity)
        self._buffers = np.zeros((7 + 3 * STAGES, model.nv))
        self._rows = np.zeros((sweeps.ROWS, model.nq))
        self._no_effort = np.zeros(model.nv)
        self.time = 0.0
        self.reset(rest_position(model) if q is None else q, self._no_effort if qd is None else qd)

    def reset(self, q, qd):
        """Put the robot into a state, at time 0."""
        self._nu = self.dynamics.nu_from_qd(q, qd)
        self._q = np.array(q, dtype=float)
        self.time = 0.0

    @property
    def damping(self):
        """Joint damping in force [N m s/rad, N s/m], shape (nv,); a copy."""
        return self._damping.copy()

    @damping.setter
    def damping(self, value):
        damping = _finite("damping", value, self.model.nv)
        if (damping < 0.0).any():
            raise InputError(f"damping is {damping.tolist()}, expected {self.model.nv} finite numbers >= 0.")
        self._damping = damping

    @property
    def q(self):
        """Positions [rad, m], shape (nv,); a copy."""
        return self._q.copy()

    @property
    def nu(self):
        """Total joint rates [J^½], shape (nv,); a copy."""
        return self._nu.copy()

    @property
    def qd(self):
        """Joint rates q̇ = ℓᵀν [rad/s, m/s], shape (nv,)."""
        return self.dynamics.qd_from_nu(self.q, self.nu)

    def advance(self, tau=None, steps=1):
        """Take `steps` steps with the joint efforts `tau` held [N m, N]; shape (nv,), None for zero.

        Raises
        ------
        InputError
            `tau` has the wrong shape or is not finite, or the motion has left what numbers can hold.
        SingularMassMatrixError
            The robot has arrived where its mass matrix is singular.
        """
        model = self.model
        tau = self._no_effort if tau is None else _finite("tau", tau, model.nv)
        if not (isinstance(steps, (int, np.integer)) and 0 <= steps < 2**63):
            raise InputError(f"steps is {steps!r}, expected a whole number >= 0 and below 2**63.")
        status = _advance(
            self._workspace.robot,
            self._order,
            self._damping,
            self._lower,
            self._upper,
            self.step_size,
            steps,
            tau,
            self._q,
            self._nu,
            self._rows,
            self._buffers,
        )
        if status:
            self.dynamics._workspace.work["D"][:] = self._workspace.work["D"]
            self.dynamics._positions(self._q)
            self.dynamics._fail(status, nu=self._nu)
        self.time += steps * self.step_size

    def evaluate(self, tau=None) -> Evaluation:
        """Everything of the diagonalized equations at the present state, as :meth:`DiagonalDynamics.evaluate`."""
        return self.dynamics.evaluate(self.q, self.qd, tau)

    @property
    def potential_energy(self):
        """Energy in the field of gravity [J], zero where the centre of mass is level with the root link."""
        return potential_energy(self.model, self.q)


def _finite(name, value, length):
    """`value` as a new vector of finite numbers."""
    try:
        vector = np.array(value, dtype=float)
    except (TypeError, ValueError):
        vector = np.array(np.nan)
    if vector.shape != (length,) or not np.isfinite(vector).all():
        raise InputError(f"{name} is {value!r}, expected {length} finite numbers.")
    return vector


def rest_position(model):
    """Zero, or the middle of a joint's limits where zero lies outside them; [rad, m], shape (nv,)."""
    lower, upper = np.maximum(model.lower, -1e6), np.minimum(model.upper, 1e6)
    outside = (lower > 0.0) | (upper < 0.0)
    return np.where(outside, 0.5 * (lower + upper), 0.0)


def potential_energy(model, q):
    """Energy of the robot in the field of gravity at q [J]: −g·Σ m_i c_i in the root link's axes."""
    own, moment = sweeps.Workspace(model.bodies, model.gravity), np.zeros(3)
    sweeps.first_moment(own.robot, _finite("q", q, model.nq), moment)
    return -float(model.gravity @ moment)


class Wave:
    """Something for a robot to do: every joint swings about the middle of its range, each at its own pace.

    The effort is that of a computed-torque controller, M(q) q̈_c + c + g + d q̇_d with q̈_c from the reference and a
    critically damped error of 5 rad/s; the damping is made up for at the desired rate, which adds to stability.

    Parameters
    ----------
    simulation : Simulation
        The robot that is to move; it is put at the middle of its ranges.
    """

    STIFFNESS, DAMPING = 25.0, 10.0
    RAMP = 1.0  # [s] time to grow to half of the full swing

    def __init__(self, simulation):
        model = simulation.model
        self._simulation = simulation
        bounded = np.isfinite(model.lower) & np.isfinite(model.upper)
        span = np.where(bounded, model.upper - model.lower, 2.0)
        lower = np.where(bounded, model.lower, 0.0)
        self._centre = np.where(bounded, lower + 0.5 * span, rest_position(model))
        self._amplitude = np.minimum(0.35 * span, 0.7)
        golden = 0.5 * (np.sqrt(5.0) - 1.0)
        k = np.arange(model.nv)
        self._pace = 2.0 * np.pi * (0.15 + 0.25 * ((k + 1) * golden % 1.0))  # [rad/s], no two alike
        self._sign = np.where(k % 2, -1.0, 1.0)
        simulation.reset(self._centre, np.zeros(model.nv))

    def effort(self):
        """Joint efforts for the simulation's present time and state [N m, N], shape (nv,)."""
        simulation = self._simulation
        t, T = simulation.time, self.RAMP
        grown, growing = t**2 / (t**2 + T**2), 2 * t * T**2 / (t**2 + T**2) ** 2
        bending = 2 * T**2 * (T**2 - 3 * t**2) / (t**2 + T**2) ** 3
        swing = self._sign * self._amplitude
        s, c, w = np.sin(self._pace * t), np.cos(self._pace * t), self._pace
        q_d = self._centre + swing * grown * s
        qd_d = swing * (growing * s + grown * w * c)
        qdd_d = swing * (bending * s + 2.0 * growing * w * c - grown * w * w * s)
        q, qd = simulation.q, simulation.qd
        qdd = qdd_d + self.DAMPING * (qd_d - qd) + self.STIFFNESS * (q_d - q)
        return simulation.dynamics.inverse_dynamics(q, qd, qdd) + simulation.damping * qd_d


@large_kernel
def _rates(robot, damping, implicit, q, nu, momentum, qd):
    """q̇ of a stage and, with damping, ν after its implicit part: (M + hγ d) q̇ = m ν_before."""
    if not implicit:
        return sweeps.qd_from_nu(robot, q, nu, qd)
    status = sweeps.rates_with_added_inertia(robot, q, nu, damping, momentum, qd)
    return status if status != 0 else sweeps.nu_from_qd(robot, q, qd, nu)


@large_kernel
def _step(robot, damping, h, tau, q, nu, rows, buffers):
    """One step of the Runge–Kutta pair from (q, ν), in place."""
    n = len(q)
    added, momentum, stage_q, stage_nu, before = buffers[0], buffers[1], buffers[2], buffers[3], buffers[4]
    rates = buffers[5 : 5 + STAGES]
    explicit = buffers[5 + STAGES : 5 + 2 * STAGES]
    implicit = buffers[5 + 2 * STAGES : 5 + 3 * STAGES]
    damped = False
    for k in range(n):
        added[k] = h * GAMMA * damping[k]
        damped |= damping[k] > 0.0
    for i in range(STAGES):
        for k in range(n):
            stage_q[k], stage_nu[k] = q[k], nu[k]
            for j in range(i):
                stage_q[k] += h * EXPLICIT[i, j] * rates[j, k]
                stage_nu[k] += h * (EXPLICIT[i, j] * explicit[j, k] + IMPLICIT[i, j] * implicit[j, k])
            before[k] = stage_nu[k]
        status = _rates(robot, added, damped and i > 0, stage_q, stage_nu, momentum, rates[i])
        if status != 0:
            return status
        if damped and i == 0:  # the first stage is explicit: ε_d from the rates
            for k in range(n):
                momentum[k] = -damping[k] * rates[0, k]
            sweeps.epsilon_from_tau(robot, stage_q, momentum, implicit[0])
        elif damped:
            for k in range(n):
                implicit[i, k] = (stage_nu[k] - before[k]) / (h * GAMMA)
        status = sweeps.evaluate(robot, stage_q, rates[i], tau, rows)
        if status != 0:
            return status
        for k in range(n):
            explicit[i, k] = rows[sweeps.EPSILON, k] - rows[sweeps.CORIOLIS, k] - rows[sweeps.GRAVITY, k]
    for k in range(n):
        for i in range(STAGES):
            q[k] += h * WEIGHTS[i] * rates[i, k]
            nu[k] += h * WEIGHTS[i] * (explicit[i, k] + implicit[i, k])
    return 0


@large_kernel
def _stop_at_limits(robot, lower, upper, q, nu, momentum, held, qd):
    """Bring joints beyond their limits back to them and take away their outward motion by impulses.

    Holding a joint can set another one moving outward at its own limit: it is held too. As held joints only get more,
    this ends after nv rounds at most.
    """
    n = len(q)
    for k in range(n):
        q[k] = min(max(q[k], lower[k]), upper[k])
    held[:] = 0.0
    status = sweeps.qd_from_nu(robot, q, nu, qd)
    while status == 0:
        more = False
        for k in range(n):
            outward = (q[k] == lower[k] and qd[k] < 0.0) or (q[k] == upper[k] and qd[k] > 0.0)
            if outward and held[k] == 0.0:
                held[k] = np.inf
                more = True
        if not more:
            break
        status = sweeps.rates_with_added_inertia(robot, q, nu, held, momentum, qd)
    return status if status != 0 else sweeps.nu_from_qd(robot, q, qd, nu)


@large_kernel
def _euler_step(robot, damping, h, tau, q, qd, buffers):
    """One step of semi-implicit Euler from (q, q̇), in place: (M + h d) q̈ = τ − d q̇ − c − g."""
    bodies, gravity, work, table = sweeps.opened(robot)
    added, effort, qdd = buffers[0], buffers[1], buffers[2]
    for k in range(len(q)):
        added[k], effort[k] = h * damping[k], tau[k] - damping[k] * qd[k]
    status = sweeps.accelerations(bodies, gravity, q, qd, effort, added, work, table[0], qdd)
    if status != 0:
        return status
    for k in range(len(q)):
        qd[k] += h * qdd[k]
        q[k] += h * qd[k]
        if not (math.isfinite(q[k]) and math.isfinite(qd[k])):
            return -1
    return 0


@large_kernel
def _is_beyond(lower, upper, q):
    """Whether a joint is beyond its limits."""
    for k in range(len(q)):
        if q[k] < lower[k] or q[k] > upper[k]:
            return True
    return False


@large_kernel
def _advance_at_order_1(robot, damping, lower, upper, h, steps, tau, q, nu, buffers):
    """As :func:`_advance`; ν is that of the last q̇."""
    qd, last_q, last_qd = buffers[3], buffers[4], buffers[5]
    status = sweeps.qd_from_nu(robot, q, nu, qd)
    if status != 0:
        return status
    for step in range(steps):
        sweeps.copy(q, last_q)
        sweeps.copy(qd, last_qd)
        status = _euler_step(robot, damping, h, tau, q, qd, buffers)
        stopped = status == 0 and _is_beyond(lower, upper, q)
        if stopped or (status == 0 and step == steps - 1):
            status = sweeps.nu_from_qd(robot, q, qd, nu)
        if stopped and status == 0:
            status = _stop_at_limits(robot, lower, upper, q, nu, buffers[1], buffers[0], buffers[2])
            if status == 0:
                status = sweeps.qd_from_nu(robot, q, nu, qd)
        if status != 0:
            return _back(robot, last_q, last_qd, status, q, nu)
    return 0


@large_kernel
def _back(robot, last_q, last_qd, status, q, nu):
    """Return to the state before a step that failed with this status, and hand the status on."""
    _, _, work, _ = sweeps.opened(robot)
    failing = work[status].D if status > 0 else 0.0
    sweeps.copy(last_q, q)
    sweeps.nu_from_qd(robot, q, last_qd, nu)
    if status > 0:
        work[status].D = failing  # what is to be told of
    return status


@entry_kernel(ROBOT, COUNT, VECTOR, VECTOR, VECTOR, NUMBER, COUNT, VECTOR, VECTOR, VECTOR, MATRIX, MATRIX, nogil=True)
def _advance(robot, order, damping, lower, upper, h, steps, tau, q, nu, rows, buffers):
    """`steps` steps from (q, ν), in place; on failure the state before the failing step is left."""
    if order == 1:
        return _advance_at_order_1(robot, damping, lower, upper, h, steps, tau, q, nu, buffers)
    last_q, last_nu = buffers[5 + 3 * STAGES], buffers[6 + 3 * STAGES]
    for _ in range(steps):
        sweeps.copy(q, last_q)
        sweeps.copy(nu, last_nu)
        status = _step(robot, damping, h, tau, q, nu, rows, buffers)
        if status == 0 and _is_beyond(lower, upper, q):
            status = _stop_at_limits(robot, lower, upper, q, nu, buffers[1], buffers[0], buffers[2])
        if status != 0:
            sweeps.copy(last_q, q)
            sweeps.copy(last_nu, nu)
            return status
    return 0
