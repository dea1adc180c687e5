"""Steps with friction and limits, many in one call."""

import math

from diag_dynamics import sweeps
from diag_dynamics.compiled.arrays import flat
from diag_dynamics.compiled.kernel import COUNT, FLAG, MATRIX, NUMBER, ROBOT, VECTOR, entry_kernel, kernel, large_kernel
from diag_dynamics.simulation.layout import (
    FREE,
    FRICTION,
    FRICTION_WORK,
    HELD,
    LIMIT_DAMPING,
    LIMIT_WORK,
    LOWER,
    STIFFNESS,
    TAKEN,
    UPPER,
)
from diag_dynamics.simulation.modes import any_held, gaps, limited, look, settle
from diag_dynamics.simulation.smooth import VECTORS, euler_move, euler_rates, glide, load_at, runge_kutta, stored

MOST_EVENTS = 4
"""Changes of mode found within a step. The rest of the step after so many is taken at once, or rattling would never end."""

TRIALS = 40
"""Trial steps to find the instant of such a change, at most; five or six usually do."""

UNMOVED = 1e-6
"""Change of rate by an impact, relative to the largest one, below which a joint at rest stays at rest."""

SOON = 1e-2
"""Part of a step: a joint that friction stops again within it counts as not moved by an impact."""

FAR = 2e-2
"""Distance [rad, m] that friction held constant would throw a joint in a step. A larger one is an impulse instead."""

NEAR = 1e-10
"""Tolerance of the instant of a change of mode, relative to the change of its gap over the step."""

(
    MODE,
    SPRING,
    DEPTH,
    NONE,
    PUSHED,
    EFFORT,
    QDD,
    NEEDED,
    MARKS,
    START_QD,
    START_NU,
    LAST_QD,
    LAST_NU,
    GAP,
    GAP_BEFORE,
    GAP_BEYOND,
    SEEN,
    TURNED,
    FREE_RATES,
) = range(VECTORS, VECTORS + 38, 2)
"""Rows of memory besides those of smooth steps; those of gaps are two."""

ROWS = VECTORS + 38

PLACE, START_Q, LAST_Q, PLACES = range(4)
"""Rows of memory with an entry for each position coordinate."""


@kernel
def touches(bounds, q):
    """Whether a coordinate is at its limits or beyond them."""
    for k in range(len(q)):
        if q[k] <= bounds[LOWER, k] or q[k] >= bounds[UPPER, k]:
            return True
    return False


@large_kernel
def _is_beyond(bodies, joints, bounds, q):
    """Whether a joint is beyond a hard limit."""
    for i in range(1, len(bodies)):
        if limited(bodies, i) and not math.isfinite(joints[STIFFNESS, bodies[i].dof]):
            x = q[bodies[i].q]
            if x < bounds[LOWER, bodies[i].q] or x > bounds[UPPER, bodies[i].q]:
                return True
    return False


@kernel
def _kinetic(nu):
    """½νᵀν [J]."""
    energy = 0.0
    for k in range(len(nu)):
        energy += 0.5 * nu[k] * nu[k]
    return energy


@large_kernel
def _potential(robot, q, moment):
    """−g·Σ m c [J]; moment is memory of at least three entries."""
    _, gravity, _, _ = sweeps.opened(robot)
    sweeps.first_moment(robot, q, moment)
    return -(gravity[0] * moment[0] + gravity[1] * moment[1] + gravity[2] * moment[2])


@large_kernel
def _begin(robot, rough, armature, joints, bounds, tau, wrenches, in_world, q, qd, memory):
    """Set the modes of the next step and hold joints accordingly. Returns a status, and whether any is held."""
    bodies, _, _, _ = sweeps.opened(robot)
    mode, pushed, effort = memory[MODE], memory[PUSHED], memory[EFFORT]
    status = load_at(robot, q, tau, wrenches, in_world, pushed)
    if status != 0 or not rough:
        return status, False
    if not look(bodies, joints, bounds, q, qd, mode, memory[SPRING], memory[DEPTH]):
        return 0, False
    for k in range(len(qd)):
        effort[k] = tau[k] + pushed[k]
    status = settle(
        robot,
        armature,
        joints,
        bounds,
        effort,
        memory[NONE],
        q,
        qd,
        mode,
        memory[SPRING],
        memory[DEPTH],
        memory[0],
        memory[QDD],
        memory[NEEDED],
    )
    return status, any_held(mode)


@large_kernel
def _let_go(robot, armature, memory):
    """Hold no joint."""
    bodies, _, _, _ = sweeps.opened(robot)
    sweeps.clear(memory[MARKS])
    sweeps.hold(bodies, armature, memory[MARKS])


@large_kernel
def _arrest(robot, q, nu, qd, memory):
    """Stop marked joints by impulses: the projection that takes the least kinetic energy, and adds none."""
    marks = memory[MARKS]
    status = sweeps.rates_with_added_inertia(robot, q, nu, marks, memory[NONE], memory[0], qd)
    for k in range(len(qd)):
        if marks[k] != 0.0:
            qd[k] = 0.0
    return status if status != 0 else sweeps.nu_from_qd(robot, q, qd, nu)


@kernel
def _turned(joints, mode, qd, k):
    """Whether a joint that slides one way moves the other."""
    return abs(mode[k]) == 1.0 and joints[FRICTION, k] > 0.0 and mode[k] * qd[k] < 0.0


@large_kernel
def _stop(robot, q, qd, nu, k, works, memory):
    """Have friction stop a joint where it is; ν follows."""
    mode, marks = memory[MODE], memory[MARKS]
    for j in range(len(qd)):
        marks[j] = math.inf if mode[j] == HELD or j == k else 0.0
    status = sweeps.nu_from_qd(robot, q, qd, nu)
    works[FRICTION_WORK] -= _kinetic(nu)
    if status == 0:
        status = _arrest(robot, q, nu, qd, memory)
    works[FRICTION_WORK] += _kinetic(nu)
    return status


@large_kernel
def _stop_at_limits(robot, joints, bounds, h, q, qd, nu, works, memory):
    """Bring joints beyond hard limits back to them and take away their outward motion by impulses.

    Holding a joint can set another one moving outward at its own limit: it is held too. Friction is no match for an
    impulse, so joints at rest may be set in motion; but those that would hardly move, or not for long, stay where they are.
    """
    bodies, _, work, _ = sweeps.opened(robot)
    marks, before = memory[MARKS], memory[QDD]
    energy = _kinetic(nu) + _potential(robot, q, flat(memory))
    sweeps.clear(marks)
    sweeps.copy(qd, before)
    for i in range(1, len(bodies)):
        if limited(bodies, i) and not math.isfinite(joints[STIFFNESS, bodies[i].dof]):
            c = bodies[i].q
            q[c] = min(max(q[c], bounds[LOWER, c]), bounds[UPPER, c])
    status = sweeps.qd_from_nu(robot, q, nu, qd)
    more = True
    while more and status == 0:
        more, largest = False, 0.0
        for k in range(len(qd)):
            largest = max(largest, abs(qd[k] - before[k]))
        for i in range(1, len(bodies)):
            k, c = bodies[i].dof, bodies[i].q
            if not sweeps.owns(bodies, i) or marks[k] != 0.0:
                continue
            rubbed = SOON * h * joints[FRICTION, k]  # work[i].D is the joint's inertia or more
            stays = before[k] == 0.0 and (abs(qd[k]) <= UNMOVED * largest or work[i].D * abs(qd[k]) <= rubbed)
            if limited(bodies, i) and not math.isfinite(joints[STIFFNESS, k]):
                stays |= (q[c] == bounds[LOWER, c] and qd[k] < 0.0) or (q[c] == bounds[UPPER, c] and qd[k] > 0.0)
            if stays:
                marks[k], more = math.inf, True
        if more:
            status = _arrest(robot, q, nu, qd, memory)
    works[LIMIT_WORK] += _kinetic(nu) + _potential(robot, q, flat(memory)) - energy
    return status


@large_kernel
def _spend_stored(bodies, joints, bounds, before, q, memory, works):
    """Count as lost the energy of springs that no joint leans on: they come back without returning it to the robot."""
    spring = memory[SPRING]
    for i in range(1, len(bodies)):
        k, c = bodies[i].dof, bodies[i].q
        if limited(bodies, i) and spring[k] == 0.0 and math.isfinite(joints[STIFFNESS, k]):
            deep = max(q[c] - bounds[UPPER, c], bounds[LOWER, c] - q[c])
            was = max(before[c] - bounds[UPPER, c], bounds[LOWER, c] - before[c])
            works[LIMIT_WORK] += stored(joints[STIFFNESS, k], deep) - stored(joints[STIFFNESS, k], was)


@kernel
def _soon(start, end, k):
    """Part of a step after which a joint that turns round in it is at rest."""
    return start[k] / (start[k] - end[k]) if start[k] * end[k] < 0.0 else 0.0


@large_kernel
def _hold_by_friction(robot, armature, joints, h, tau, q, start, qd, nu, works, memory, all_of_them):
    """Correct the rates of a step of order 1 for joints that come to rest in it. Returns a status.

    A joint that friction would turn round stops at the start, and is held; one that turns round without it goes on, rubbed
    from the other side. One after the other, the first to come to rest first: whether the others do may be another matter
    then. If not `all_of_them`, only those are stopped that would stop so soon, or be thrown so far, that no step of order 4
    may be tried with their friction in it, and nothing else is changed. `start` are the rates at the start; ν is memory.
    """
    bodies, _, _, _ = sweeps.opened(robot)
    n, mode, seen, turned, free = len(qd), memory[MODE], memory[SEEN], memory[TURNED], memory[FREE_RATES]
    spring, depth, pushed = memory[SPRING], memory[DEPTH], memory[PUSHED]
    sweeps.clear(seen)
    while True:
        status = euler_rates(robot, joints, h, tau, pushed, mode, spring, depth, q, start, qd, memory)
        if status != 0:
            return status
        found = False
        for k in range(n):
            turned[k] = 0.0
            matters = all_of_them or (seen[k] == 0.0 and (_soon(start, qd, k) < SOON or h * abs(qd[k]) > FAR))
            if matters and _turned(joints, mode, qd, k):
                turned[k], mode[k], found = mode[k], FREE, True
        if not found:
            return 0
        status = euler_rates(robot, joints, h, tau, pushed, mode, spring, depth, q, start, free, memory)
        if status != 0:
            return status
        first, soonest = -1, math.inf
        for k in range(n):
            if turned[k] != 0.0:
                mode[k] = turned[k]
                alone = turned[k] * free[k] < 0.0 and abs(free[k]) > abs(qd[k] - free[k]) and start[k] != 0.0
                if (seen[k] != 0.0 or not alone) and _soon(start, qd, k) < soonest:
                    first, soonest = k, _soon(start, qd, k)
        if first >= 0:
            status = _stop(robot, q, start, nu, first, works, memory)
            if status != 0:
                return status
            mode[first] = HELD
            sweeps.hold(bodies, armature, memory[MARKS])
        for k in range(n):
            if first >= 0 and seen[k] != 0.0 and abs(mode[k]) == 1.0 and start[k] != 0.0:
                mode[k], seen[k] = math.copysign(1.0, start[k]), 0.0  # the other joints at rest may move now, too
            elif first < 0 and turned[k] != 0.0:
                seen[k] = 1.0
                mode[k] = -mode[k] if all_of_them else mode[k]


# --- Order 1 ----------------------------------------------------------------------------------------------


@large_kernel
def _euler_with_limits(robot, flat, armature, joints, bounds, h, tau, q, qd, nu, works, memory, places):
    """A step of order 1, taken anew until every joint that comes to a compliant limit in it leans on that."""
    bodies, _, _, _ = sweeps.opened(robot)
    mode, spring, depth = memory[MODE], memory[SPRING], memory[DEPTH]
    start_q, start_qd = places[START_Q], memory[START_QD]
    sweeps.copy(q, start_q)
    sweeps.copy(qd, start_qd)
    while True:
        status = _hold_by_friction(robot, armature, joints, h, tau, q, start_qd, qd, nu, works[0], memory, True)
        sweeps.copy(works[0], works[1])
        if status == 0:
            status = euler_move(
                robot, flat, joints, h, tau, memory[PUSHED], mode, spring, depth, start_qd, q, qd, works[1], memory
            )
        if status != 0:
            return status
        more = False
        for i in range(1, len(bodies)):
            k, c = bodies[i].dof, bodies[i].q
            if limited(bodies, i) and spring[k] == 0.0 and mode[k] != HELD and math.isfinite(joints[STIFFNESS, k]):
                side = 1.0 if q[c] > bounds[UPPER, c] else -1.0 if q[c] < bounds[LOWER, c] else 0.0
                if side != 0.0 and side * qd[k] > 0.0:
                    spring[k], more = side, True
                    depth[k] = start_q[c] - bounds[UPPER if side > 0.0 else LOWER, c]
        if not more:
            break
        sweeps.copy(start_q, q)
    sweeps.copy(works[1], works[0])
    _spend_stored(bodies, joints, bounds, start_q, q, memory, works[0])
    return 0


@large_kernel
def _step_of_order_1(
    robot, flat, armature, joints, bounds, rough, h, tau, wrenches, in_world, q, qd, nu, works, memory, places
):
    """One step of order 1 from (q, q̇), in place; ν is memory."""
    bodies, _, _, _ = sweeps.opened(robot)
    mode, spring, depth, gap = memory[MODE], memory[SPRING], memory[DEPTH], memory[GAP : GAP + 2]
    status, _ = _begin(robot, rough, armature, joints, bounds, tau, wrenches, in_world, q, qd, memory)
    if status != 0:
        return status
    if rough:
        status = _euler_with_limits(robot, flat, armature, joints, bounds, h, tau, q, qd, nu, works, memory, places)
    else:
        pushed = memory[PUSHED]
        status = euler_rates(robot, joints, h, tau, pushed, mode, spring, depth, q, qd, qd, memory)
        if status == 0:
            status = euler_move(robot, flat, joints, h, tau, pushed, mode, spring, depth, qd, q, qd, works[0], memory)
    if rough:
        _let_go(robot, armature, memory)
    if status == 0 and (rough or touches(bounds, q)) and gaps(bodies, joints, bounds, q, qd, mode, spring, depth, gap):
        status = sweeps.nu_from_qd(robot, q, qd, nu)
        if status == 0:
            status = _stop_at_limits(robot, joints, bounds, h, q, qd, nu, works[0], memory)
    return status


# --- Order 4 ----------------------------------------------------------------------------------------------


@large_kernel
def _guess(a, b, before, beyond):
    """When a gap that is open at b and not at a opens first, from straight lines; the middle where a says nothing."""
    first = b
    for row in range(2):
        for k in range(before.shape[1]):
            if beyond[row, k] > 0.0:
                g, other = before[row, k], beyond[row, k]
                when = a + (b - a) * (g / (g - other)) if -math.inf < g < 0.0 else 0.5 * (a + b)
                first = min(first, when)
    return first


@large_kernel
def _furthest(gap, scale, beyond):
    """The largest gap of those that open over the whole step, each as part of its change over it."""
    largest = -math.inf
    for row in range(2):
        for k in range(gap.shape[1]):
            if beyond[row, k] > 0.0 or gap[row, k] > 0.0:
                largest = max(largest, gap[row, k] / scale[row, k])
    return largest


@large_kernel
def _find_event(robot, flat, joints, bounds, h, tau, wrenches, in_world, q, qd, nu, works, memory, places, rows):
    """Go to the first instant at which a joint's mode ends, known to be within h; returns a status, and that instant.

    The start is in memory, and the gaps at the end. Each trial is a step of its own from there: false position, and
    bisection where that is slow.
    """
    bodies, _, _, _ = sweeps.opened(robot)
    mode, spring, depth = memory[MODE], memory[SPRING], memory[DEPTH]
    gap, before, beyond = (
        memory[GAP : GAP + 2],
        memory[GAP_BEFORE : GAP_BEFORE + 2],
        memory[GAP_BEYOND : GAP_BEYOND + 2],
    )
    scale = memory[EFFORT : EFFORT + 2]
    gaps(bodies, joints, bounds, places[START_Q], memory[START_QD], mode, spring, depth, before)
    for row in range(2):
        for k in range(len(qd)):
            change = gap[row, k] - before[row, k] if before[row, k] > -math.inf else gap[row, k]
            beyond[row, k] = gap[row, k]
            scale[row, k] = max(abs(change), 1e-300)
    a, b, width = 0.0, h, h
    when = h
    for trial in range(TRIALS):
        slow = trial % 3 == 2 and b - a > 0.25 * width
        when = 0.5 * (a + b) if slow else _guess(a, b, before, beyond)
        width = b - a
        sweeps.copy(places[START_Q], q)
        sweeps.copy(memory[START_QD], qd)
        sweeps.copy(memory[START_NU], nu)
        sweeps.clear(works[1])
        status = runge_kutta(
            robot,
            flat,
            joints,
            when,
            tau,
            wrenches,
            in_world,
            mode,
            spring,
            depth,
            q,
            qd,
            nu,
            works[1],
            memory,
            places[PLACE],
            rows,
        )
        if status != 0:
            return status, when
        gaps(bodies, joints, bounds, q, qd, mode, spring, depth, gap)
        furthest = _furthest(gap, scale, beyond)
        if abs(furthest) <= NEAR:
            break
        if furthest > 0.0:
            b = when
            sweeps.copy(gap[0], beyond[0])
            sweeps.copy(gap[1], beyond[1])
        else:
            a = when
            sweeps.copy(gap[0], before[0])
            sweeps.copy(gap[1], before[1])
    return 0, when


@large_kernel
def _apply_event(robot, joints, bounds, h, q, qd, nu, works, memory):
    """End the modes whose gaps have closed: exactly at the limit, exactly at rest."""
    bodies, _, _, _ = sweeps.opened(robot)
    mode, spring, marks = memory[MODE], memory[SPRING], memory[MARKS]
    gap, beyond, scale = memory[GAP : GAP + 2], memory[GAP_BEYOND : GAP_BEYOND + 2], memory[EFFORT : EFFORT + 2]
    slid, struck = False, False
    sweeps.clear(marks)
    for i in range(1, len(bodies)):
        k = bodies[i].dof
        if not sweeps.owns(bodies, i):
            continue
        if beyond[0, k] > 0.0 and gap[0, k] >= -10.0 * NEAR * scale[0, k]:
            marks[k], slid = math.inf, True
        if beyond[1, k] > 0.0 and gap[1, k] >= -10.0 * NEAR * scale[1, k]:
            c = bodies[i].q
            upper = abs(q[c] - bounds[UPPER, c]) < abs(q[c] - bounds[LOWER, c])
            near = bounds[UPPER, c] if upper else bounds[LOWER, c]
            if not math.isfinite(joints[STIFFNESS, k]):
                q[c], struck = near, True
            elif memory[DEPTH, k] == 0.0 and spring[k] == 0.0:
                q[c] = near
            elif joints[LIMIT_DAMPING, k] == 0.0 and spring[k] != 0.0:
                q[c] = near  # a spring without a damper lets go where it is not strained
    status = 0
    if slid:
        before = _kinetic(nu)
        for k in range(len(qd)):
            marks[k] = math.inf if mode[k] == HELD else marks[k]
        status = _arrest(robot, q, nu, qd, memory)
        works[FRICTION_WORK] += _kinetic(nu) - before
    if struck and status == 0:
        status = _stop_at_limits(robot, joints, bounds, h, q, qd, nu, works, memory)
    return status


@kernel
def _flies_in(bodies, joints, gap):
    """Whether a joint has gone through a compliant limit without leaning on it."""
    for i in range(1, len(bodies)):
        if limited(bodies, i) and math.isfinite(joints[STIFFNESS, bodies[i].dof]) and gap[1, bodies[i].dof] > 0.0:
            return True
    return False


@kernel
def _slides(mode):
    """Whether a joint slides: its mode is 1 or −1."""
    for k in range(len(mode)):
        if abs(mode[k]) == 1.0:
            return True
    return False


@large_kernel
def _step_of_order_4(
    robot, flat, armature, joints, bounds, rough, h, tau, wrenches, in_world, q, qd, nu, works, memory, places, rows
):
    """One step of order 4 from (q, q̇, ν), in place, in parts between which joints change their modes.

    After as many parts as there may be, the rest is taken at once, at order 1 should friction or a limit that comes into
    it add energy otherwise.
    """
    bodies, _, _, _ = sweeps.opened(robot)
    mode, spring, depth, gap = memory[MODE], memory[SPRING], memory[DEPTH], memory[GAP : GAP + 2]
    remaining, parts = h, 0
    while True:
        status, holding = _begin(robot, rough, armature, joints, bounds, tau, wrenches, in_world, q, qd, memory)
        if status == 0 and rough and _slides(memory[MODE]):
            status = _hold_by_friction(
                robot, armature, joints, remaining, tau, q, qd, memory[EFFORT], nu, works[0], memory, False
            )
            holding = any_held(memory[MODE])
        if status == 0 and holding:
            status = sweeps.nu_from_qd(robot, q, qd, nu)
        if status != 0:
            return status
        sweeps.copy(q, places[START_Q])
        sweeps.copy(qd, memory[START_QD])
        sweeps.copy(nu, memory[START_NU])
        sweeps.clear(works[1])
        status = runge_kutta(
            robot,
            flat,
            joints,
            remaining,
            tau,
            wrenches,
            in_world,
            mode,
            spring,
            depth,
            q,
            qd,
            nu,
            works[1],
            memory,
            places[PLACE],
            rows,
        )
        if status != 0:
            return status
        changes = (rough or touches(bounds, q)) and gaps(bodies, joints, bounds, q, qd, mode, spring, depth, gap)
        located = changes and parts < MOST_EVENTS
        parts += 1
        if changes and not located and (works[1, FRICTION_WORK] > 0.0 or _flies_in(bodies, joints, gap)):
            sweeps.copy(places[START_Q], q)
            sweeps.copy(memory[START_QD], qd)
            if holding:
                _let_go(robot, armature, memory)
            break
        if located:
            status, taken = _find_event(
                robot, flat, joints, bounds, remaining, tau, wrenches, in_world, q, qd, nu, works, memory, places, rows
            )
            if status != 0:
                return status
            remaining -= taken
        if holding:
            _let_go(robot, armature, memory)
            status = sweeps.nu_from_qd(robot, q, qd, nu)
        for j in range(works.shape[1]):
            works[0, j] += works[1, j]
        if rough:
            _spend_stored(bodies, joints, bounds, places[START_Q], q, memory, works[0])
        if status == 0 and located:
            status = _apply_event(robot, joints, bounds, h, q, qd, nu, works[0], memory)
            rough = True
        elif status == 0 and changes:
            status = _stop_at_limits(robot, joints, bounds, h, q, qd, nu, works[0], memory)
        if status != 0 or not located or remaining <= 0.0:
            return status
    status = _step_of_order_1(
        robot,
        flat,
        armature,
        joints,
        bounds,
        rough,
        remaining,
        tau,
        wrenches,
        in_world,
        q,
        qd,
        nu,
        works,
        memory,
        places,
    )
    return status if status != 0 else sweeps.nu_from_qd(robot, q, qd, nu)


# --- Any order --------------------------------------------------------------------------------------------


@entry_kernel(
    ROBOT,
    COUNT,
    FLAG,
    VECTOR,
    MATRIX,
    MATRIX,
    NUMBER,
    COUNT,
    VECTOR,
    sweeps.WRENCHES,
    FLAG,
    VECTOR,
    VECTOR,
    VECTOR,
    MATRIX,
    MATRIX,
    MATRIX,
    MATRIX,
    nogil=True,
)
def advance(
    robot,
    order,
    flat,
    armature,
    joints,
    bounds,
    h,
    steps,
    tau,
    wrenches,
    in_world,
    q,
    qd,
    nu,
    works,
    memory,
    places,
    rows,
):
    """`steps` steps from (q, q̇, ν), in place; on failure the state before the failing step is left.

    `works` has three rows: what has been done, and memory. `flat`: no joint has several degrees of freedom.
    """
    bodies, _, work, _ = sweeps.opened(robot)
    rubs = False
    for k in range(len(qd)):
        rubs |= joints[FRICTION, k] > 0.0 or math.isfinite(joints[STIFFNESS, k])
    last_q, last_qd, last_nu = places[LAST_Q], memory[LAST_QD], memory[LAST_NU]
    sweeps.copy(q, last_q)
    sweeps.copy(qd, last_qd)
    sweeps.copy(nu, last_nu)
    sweeps.copy(works[0], works[2])
    memory[MODE], memory[SPRING], memory[DEPTH], memory[NONE], memory[PUSHED] = 0.0, 0.0, 0.0, 0.0, 0.0
    status = 0
    touching = touches(bounds, q)
    if touching and steps > 0 and _is_beyond(bodies, joints, bounds, q):
        status = _stop_at_limits(robot, joints, bounds, h, q, qd, nu, works[0], memory)
    plain = order == 1 and flat and not rubs and len(wrenches) == 0
    taken = 0
    while status == 0 and taken < steps:
        if plain and not touching:
            taken += glide(
                robot,
                joints,
                bounds,
                h,
                steps - taken,
                tau,
                q,
                qd,
                last_q,
                last_qd,
                memory[0],
                memory[1],
                memory[2],
                memory[3],
                works[0],
            )
            if taken == steps:
                break
        taken += 1
        sweeps.copy(q, last_q)
        sweeps.copy(qd, last_qd)
        rough = rubs or touching
        sweeps.copy(works[0], works[2])
        if order == 1:
            status = _step_of_order_1(
                robot,
                flat,
                armature,
                joints,
                bounds,
                rough,
                h,
                tau,
                wrenches,
                in_world,
                q,
                qd,
                nu,
                works,
                memory,
                places,
            )
        else:
            sweeps.copy(nu, last_nu)
            status = _step_of_order_4(
                robot,
                flat,
                armature,
                joints,
                bounds,
                rough,
                h,
                tau,
                wrenches,
                in_world,
                q,
                qd,
                nu,
                works,
                memory,
                places,
                rows,
            )
        touching = touches(bounds, q)
        if rough and not (rubs or touching):  # nothing looks at modes any more
            memory[MODE], memory[SPRING], memory[DEPTH] = 0.0, 0.0, 0.0
    if status == 0 and order == 1 and steps > 0:
        status = sweeps.nu_from_qd(robot, q, qd, nu)
    energy = _kinetic(nu)
    if status == 0 and steps > 0 and not math.isfinite(energy):
        status = -1
    if status != 0:
        failing = work[status].D if status > 0 else 0.0
        _let_go(robot, armature, memory)
        sweeps.copy(last_q, q)
        sweeps.copy(last_qd, qd)
        sweeps.copy(works[2], works[0])
        taken -= 1
        if order == 1:
            sweeps.nu_from_qd(robot, q, qd, nu)
        else:
            sweeps.copy(last_nu, nu)
        if status > 0:
            work[status].D = failing  # work to be reported
    works[0, TAKEN] += max(taken, 0)
    return status
