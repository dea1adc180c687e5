# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Steps with friction and limits, many in one call."""

import math

from diag_dynamics import sweeps
from diag_dynamics.compiled.kernel import COUNT, FLAG, NUMBER, ROBOT, VECTOR, entry_kernel, kernel, large_kernel
from diag_dynamics.simulation.friction_and_limits import any_held, compliant, gaps, limited, look, settle
from diag_dynamics.simulation.layout import (
    FREE,
    HELD,
    Load,
    add_works,
    clear_works,
    conduct_of,
    copy_state,
    copy_works,
    gaps_of,
    last_of,
    memory_of,
    moment_of,
    simulation_at,
    start_of,
    state_of,
    system_of,
)
from diag_dynamics.simulation.smooth import euler_move, euler_rates, glide, load_at, runge_kutta, stored

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

ALL, FEW = 1.0, 2.0
"""Which joints :func:`_hold_by_friction` is for: no flag, as numba compiles a function for True, and for False once more."""

NEAR = 1e-10
"""Tolerance of the instant of a change of mode, relative to the change of its gap over the step."""


@kernel
def touches(bounds, q):
    """Whether a coordinate is at its limits or beyond them."""
    for k in range(len(q)):
        if q[k] <= bounds[k].lower or q[k] >= bounds[k].upper:
            return True
    return False


@kernel
def _is_hard(system, i):
    """Whether a body's degree of freedom may have hard limits."""
    return limited(system.bodies, i) and not compliant(system.joints[system.bodies[i].dof])


@large_kernel
def _is_beyond(simulation):
    """Whether a joint is beyond a hard limit."""
    system, q = system_of(simulation), state_of(simulation).q
    for i in range(1, len(system.bodies)):
        if _is_hard(system, i):
            c = system.bodies[i].q
            if q[c] < system.bounds[c].lower or q[c] > system.bounds[c].upper:
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
def _potential(simulation):
    """−g·Σ m c [J]."""
    robot, moment = simulation.robot, moment_of(simulation)
    _, gravity, _, _ = sweeps.opened(robot)
    sweeps.first_moment(robot, state_of(simulation).q, moment)
    return -(gravity[0] * moment[0] + gravity[1] * moment[1] + gravity[2] * moment[2])


@large_kernel
def _begin(simulation, rough, load):
    """Set the modes of the next step and hold joints accordingly. Returns a status, and whether any is held."""
    memory = memory_of(simulation)
    status = load_at(simulation.robot, state_of(simulation).q, load, memory.pushed)
    if status != 0 or not rough:
        return status, False
    if not look(simulation):
        return 0, False
    for k in range(len(load.tau)):
        memory.applied[k] = load.tau[k] + memory.pushed[k]
    status = settle(simulation)
    return status, any_held(conduct_of(simulation))


@large_kernel
def _let_go(simulation):
    """Hold no joint."""
    system, marks = system_of(simulation), memory_of(simulation).marks
    sweeps.clear(marks)
    sweeps.hold(system.bodies, system.armature, marks)


@large_kernel
def _arrest(simulation, qd):
    """Stop marked joints by impulses: the projection that takes the least kinetic energy, and adds none. ν follows."""
    robot, state, memory = simulation.robot, state_of(simulation), memory_of(simulation)
    q, nu, marks = state.q, state.nu, memory.marks
    status = sweeps.rates_with_added_inertia(robot, q, nu, marks, memory.none, memory.momentum, qd)
    for k in range(len(qd)):
        if marks[k] != 0.0:
            qd[k] = 0.0
    return status if status != 0 else sweeps.nu_from_qd(robot, q, qd, nu)


@kernel
def _turned(joint, does, rate):
    """Whether a joint that slides one way moves the other."""
    return abs(does.mode) == 1.0 and joint.friction > 0.0 and does.mode * rate < 0.0


@large_kernel
def _stop(simulation, qd, k):
    """Have friction stop a joint where it is; ν follows."""
    state, conduct, works = state_of(simulation), conduct_of(simulation), simulation.done
    marks, nu = memory_of(simulation).marks, state.nu
    for j in range(len(qd)):
        marks[j] = math.inf if conduct[j].mode == HELD or j == k else 0.0
    status = sweeps.nu_from_qd(simulation.robot, state.q, qd, nu)
    works.friction -= _kinetic(nu)
    if status == 0:
        status = _arrest(simulation, qd)
    works.friction += _kinetic(nu)
    return status


@large_kernel
def _stop_at_limits(simulation, h):
    """Bring joints beyond hard limits back to them and take away their outward motion by impulses.

    Holding a joint can set another one moving outward at its own limit: it is held too. Friction is no match for an
    impulse, so joints at rest may be set in motion; but those that would hardly move, or not for long, stay where they are.
    """
    system, state, memory = system_of(simulation), state_of(simulation), memory_of(simulation)
    robot, bodies, bounds, (q, qd, nu) = system.robot, system.bodies, system.bounds, state
    marks, before = memory.marks, memory.before
    energy = _kinetic(nu) + _potential(simulation)
    sweeps.clear(marks)
    sweeps.copy(qd, before)
    for i in range(1, len(bodies)):
        if _is_hard(system, i):
            c = bodies[i].q
            q[c] = min(max(q[c], bounds[c].lower), bounds[c].upper)
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
            D = system.work[i].D  # the joint's inertia or more
            rubbed = SOON * h * system.joints[k].friction
            stays = before[k] == 0.0 and (abs(qd[k]) <= UNMOVED * largest or D * abs(qd[k]) <= rubbed)
            if _is_hard(system, i):
                stays |= (q[c] == bounds[c].lower and qd[k] < 0.0) or (q[c] == bounds[c].upper and qd[k] > 0.0)
            if stays:
                marks[k], more = math.inf, True
        if more:
            status = _arrest(simulation, qd)
    simulation.done.limits += _kinetic(nu) + _potential(simulation) - energy
    return status


@large_kernel
def _spend_stored(simulation):
    """Count as lost the energy of springs that no joint leans on: they come back without returning it to the robot."""
    system, conduct = system_of(simulation), conduct_of(simulation)
    bodies, before, q = system.bodies, start_of(simulation).q, state_of(simulation).q
    for i in range(1, len(bodies)):
        k, c = bodies[i].dof, bodies[i].q
        joint = system.joints[k]
        if limited(bodies, i) and conduct[k].spring == 0.0 and compliant(joint):
            bound = system.bounds[c]
            deep = max(q[c] - bound.upper, bound.lower - q[c])
            was = max(before[c] - bound.upper, bound.lower - before[c])
            simulation.done.limits += stored(joint.stiffness, deep) - stored(joint.stiffness, was)


@kernel
def _soon(start, end, k):
    """Part of a step after which a joint that turns round in it is at rest."""
    return start[k] / (start[k] - end[k]) if start[k] * end[k] < 0.0 else 0.0


@large_kernel
def _hold_by_friction(simulation, h, tau, start, qd, which):
    """Correct the rates of a step of order 1 for joints that come to rest in it. Returns a status.

    A joint that friction would turn round stops at the start, and is held; one that turns round without it goes on, rubbed
    from the other side. One after the other, the first to come to rest first: whether the others do may be another matter
    then. That is of :data:`ALL`. Of a :data:`FEW`, only those are stopped that would stop so soon, or be thrown so far, that
    no step of order 4 may be tried with their friction in it, and nothing else is changed. `start` are the rates at the
    start, `qd` those that are corrected; ν is memory.
    """
    system, memory, conduct = system_of(simulation), memory_of(simulation), conduct_of(simulation)
    n, joints, loose, all_of_them = len(qd), system.joints, memory.loose, which == ALL
    for k in range(n):
        conduct[k].seen = False
    while True:
        status = euler_rates(simulation, h, tau, start, qd)
        if status != 0:
            return status
        found = False
        for k in range(n):
            conduct[k].turned = 0.0
            matters = all_of_them or (not conduct[k].seen and (_soon(start, qd, k) < SOON or h * abs(qd[k]) > FAR))
            if matters and _turned(joints[k], conduct[k], qd[k]):
                conduct[k].turned, conduct[k].mode, found = conduct[k].mode, FREE, True
        if not found:
            return 0
        status = euler_rates(simulation, h, tau, start, loose)
        if status != 0:
            return status
        first, soonest = -1, math.inf
        for k in range(n):
            if conduct[k].turned != 0.0:
                conduct[k].mode = conduct[k].turned
                alone = conduct[k].turned * loose[k] < 0.0 and abs(loose[k]) > abs(qd[k] - loose[k]) and start[k] != 0.0
                if (conduct[k].seen or not alone) and _soon(start, qd, k) < soonest:
                    first, soonest = k, _soon(start, qd, k)
        if first >= 0:
            status = _stop(simulation, start, first)
            if status != 0:
                return status
            conduct[first].mode = HELD
            sweeps.hold(system.bodies, system.armature, memory.marks)
        for k in range(n):
            if first >= 0 and conduct[k].seen and abs(conduct[k].mode) == 1.0 and start[k] != 0.0:
                conduct[k].mode, conduct[k].seen = (
                    math.copysign(1.0, start[k]),
                    False,
                )  # the other joints at rest may move now, too
            elif first < 0 and conduct[k].turned != 0.0:
                conduct[k].seen = True
                conduct[k].mode = -conduct[k].mode if all_of_them else conduct[k].mode


# --- Order 1 ----------------------------------------------------------------------------------------------


@large_kernel
def _euler_with_limits(simulation, h, tau):
    """A step of order 1, taken anew until every joint that comes to a compliant limit in it leans on that."""
    system, state, start = system_of(simulation), state_of(simulation), start_of(simulation)
    bodies, q, qd, conduct = system.bodies, state.q, state.qd, conduct_of(simulation)
    copy_state(state, start)
    while True:
        status = _hold_by_friction(simulation, h, tau, start.qd, qd, ALL)
        copy_works(simulation.done, simulation.part)
        if status == 0:
            status = euler_move(simulation, h, tau, start.qd, simulation.part)
        if status != 0:
            return status
        more = False
        for i in range(1, len(bodies)):
            k, c = bodies[i].dof, bodies[i].q
            if (
                limited(bodies, i)
                and conduct[k].spring == 0.0
                and conduct[k].mode != HELD
                and compliant(system.joints[k])
            ):
                bound = system.bounds[c]
                side = 1.0 if q[c] > bound.upper else -1.0 if q[c] < bound.lower else 0.0
                if side != 0.0 and side * qd[k] > 0.0:
                    conduct[k].spring, more = side, True
                    conduct[k].depth = start.q[c] - (bound.upper if side > 0.0 else bound.lower)
        if not more:
            break
        sweeps.copy(start.q, q)
    copy_works(simulation.part, simulation.done)
    _spend_stored(simulation)
    return 0


@large_kernel
def _step_of_order_1(simulation, rough, h, load):
    """One step of order 1 from (q, q̇), in place; ν is memory."""
    state, tau = state_of(simulation), load.tau
    q, qd, nu = state
    status, _ = _begin(simulation, rough, load)
    if status != 0:
        return status
    if rough:
        status = _euler_with_limits(simulation, h, tau)
        _let_go(simulation)
    else:
        status = euler_rates(simulation, h, tau, qd, qd)
        if status == 0:
            status = euler_move(simulation, h, tau, qd, simulation.done)
    if status == 0 and _changes(simulation, rough):
        status = sweeps.nu_from_qd(simulation.robot, q, qd, nu)
        if status == 0:
            status = _stop_at_limits(simulation, h)
    return status


@large_kernel
def _changes(simulation, rough):
    """Whether a joint is beyond the end of its mode now; the gaps are then in memory."""
    state = state_of(simulation)
    if not (rough or touches(system_of(simulation).bounds, state.q)):
        return False
    return gaps(simulation, state.q, state.qd, gaps_of(simulation).now)


# --- Order 4 ----------------------------------------------------------------------------------------------


@kernel
def _when(a, b, before, beyond):
    """When a gap that is open at b and not at a opens, from a straight line; the middle where a says nothing."""
    return a + (b - a) * (before / (before - beyond)) if -math.inf < before < 0.0 else 0.5 * (a + b)


@large_kernel
def _guess(a, b, before, beyond):
    """When the first of the gaps that are open at b and not at a opens."""
    first = b
    for k in range(len(before)):
        if beyond[k].sliding > 0.0:
            first = min(first, _when(a, b, before[k].sliding, beyond[k].sliding))
        if beyond[k].limit > 0.0:
            first = min(first, _when(a, b, before[k].limit, beyond[k].limit))
    return first


@large_kernel
def _furthest(gap, scale, beyond):
    """The largest gap of those that open over the whole step, each as part of its change over it."""
    largest = -math.inf
    for k in range(len(gap)):
        if beyond[k].sliding > 0.0 or gap[k].sliding > 0.0:
            largest = max(largest, gap[k].sliding / scale[k].sliding)
        if beyond[k].limit > 0.0 or gap[k].limit > 0.0:
            largest = max(largest, gap[k].limit / scale[k].limit)
    return largest


@kernel
def _change(before, now):
    """Size of a gap's change over the step, never 0."""
    return max(abs(now - before if before > -math.inf else now), 1e-300)


@kernel
def _copy_gaps(source, target):
    """Overwrite gaps by others."""
    for k in range(len(source)):
        target[k].sliding, target[k].limit = source[k].sliding, source[k].limit


@large_kernel
def _find_event(simulation, h, load):
    """Go to the first instant at which a joint's mode ends, known to be within h; returns a status, and that instant.

    The start is in memory, and the gaps at the end. Each trial is a step of its own from there: false position, and
    bisection where that is slow.
    """
    state, start, gap = state_of(simulation), start_of(simulation), gaps_of(simulation)
    gaps(simulation, start.q, start.qd, gap.start)
    _copy_gaps(gap.now, gap.end)
    for k in range(len(gap.now)):
        first, last, scale = gap.start[k], gap.end[k], gap.scale[k]
        scale.sliding, scale.limit = _change(first.sliding, last.sliding), _change(first.limit, last.limit)
    a, b, width = 0.0, h, h
    when = h
    for trial in range(TRIALS):
        slow = trial % 3 == 2 and b - a > 0.25 * width
        when = 0.5 * (a + b) if slow else _guess(a, b, gap.start, gap.end)
        width = b - a
        copy_state(start, state)
        clear_works(simulation.part)
        status = runge_kutta(simulation, when, load)
        if status != 0:
            return status, when
        gaps(simulation, state.q, state.qd, gap.now)
        furthest = _furthest(gap.now, gap.scale, gap.end)
        if abs(furthest) <= NEAR:
            break
        if furthest > 0.0:
            b = when
            _copy_gaps(gap.now, gap.end)
        else:
            a = when
            _copy_gaps(gap.now, gap.start)
    return 0, when


@kernel
def _closed(gap, beyond, scale):
    """Whether a gap that opens within the step has been found to open just now."""
    return beyond > 0.0 and gap >= -10.0 * NEAR * scale


@large_kernel
def _apply_event(simulation, h):
    """End the modes whose gaps have closed: exactly at the limit, exactly at rest."""
    system, conduct, gap = system_of(simulation), conduct_of(simulation), gaps_of(simulation)
    bodies, marks, (q, qd, nu) = system.bodies, memory_of(simulation).marks, state_of(simulation)
    slid, struck = False, False
    sweeps.clear(marks)
    for i in range(1, len(bodies)):
        k = bodies[i].dof
        if not sweeps.owns(bodies, i):
            continue
        now, end, scale = gap.now[k], gap.end[k], gap.scale[k]
        if _closed(now.sliding, end.sliding, scale.sliding):
            marks[k], slid = math.inf, True
        if _closed(now.limit, end.limit, scale.limit):
            c = bodies[i].q
            bound, joint = system.bounds[c], system.joints[k]
            upper = abs(q[c] - bound.upper) < abs(q[c] - bound.lower)
            near = bound.upper if upper else bound.lower
            if not compliant(joint):
                q[c], struck = near, True
            elif conduct[k].depth == 0.0 and conduct[k].spring == 0.0:
                q[c] = near
            elif joint.limit_damping == 0.0 and conduct[k].spring != 0.0:
                q[c] = near  # a spring without a damper lets go where it is not strained
    status = 0
    if slid:
        before = _kinetic(nu)
        for k in range(len(marks)):
            marks[k] = math.inf if conduct[k].mode == HELD else marks[k]
        status = _arrest(simulation, qd)
        simulation.done.friction += _kinetic(nu) - before
    if struck and status == 0:
        status = _stop_at_limits(simulation, h)
    return status


@kernel
def _flies_in(simulation):
    """Whether a joint has gone through a compliant limit without leaning on it."""
    system, gap = system_of(simulation), gaps_of(simulation).now
    for i in range(1, len(system.bodies)):
        k = system.bodies[i].dof
        if limited(system.bodies, i) and compliant(system.joints[k]) and gap[k].limit > 0.0:
            return True
    return False


@kernel
def _slides(conduct):
    """Whether a joint slides: its mode is 1 or −1."""
    for k in range(len(conduct)):
        if abs(conduct[k].mode) == 1.0:
            return True
    return False


@large_kernel
def _step_of_order_4(simulation, rough, h, load):
    """One step of order 4 from (q, q̇, ν), in place, in parts between which joints change their modes.

    After as many parts as there may be, the rest is taken at once, at order 1 should friction or a limit that comes into
    it add energy otherwise.
    """
    robot, state, start, conduct = simulation.robot, state_of(simulation), start_of(simulation), conduct_of(simulation)
    q, qd, nu = state
    remaining, parts = h, 0
    while True:
        status, holding = _begin(simulation, rough, load)
        if status == 0 and rough and _slides(conduct):
            status = _hold_by_friction(simulation, remaining, load.tau, qd, memory_of(simulation).after, FEW)
            holding = any_held(conduct)
        if status == 0 and holding:
            status = sweeps.nu_from_qd(robot, q, qd, nu)
        if status != 0:
            return status
        copy_state(state, start)
        clear_works(simulation.part)
        status = runge_kutta(simulation, remaining, load)
        if status != 0:
            return status
        changes = _changes(simulation, rough)
        located = changes and parts < MOST_EVENTS
        parts += 1
        if changes and not located and (simulation.part.friction > 0.0 or _flies_in(simulation)):
            copy_state(start, state)
            if holding:
                _let_go(simulation)
            break
        if located:
            status, taken = _find_event(simulation, remaining, load)
            if status != 0:
                return status
            remaining -= taken
        if holding:
            _let_go(simulation)
            status = sweeps.nu_from_qd(robot, q, qd, nu)
        add_works(simulation.part, simulation.done)
        if rough:
            _spend_stored(simulation)
        if status == 0 and located:
            status = _apply_event(simulation, h)
            rough = True
        elif status == 0 and changes:
            status = _stop_at_limits(simulation, h)
        if status != 0 or not located or remaining <= 0.0:
            return status
    status = _step_of_order_1(simulation, rough, remaining, load)
    return status if status != 0 else sweeps.nu_from_qd(robot, q, qd, nu)


# --- Any order --------------------------------------------------------------------------------------------


@kernel
def _forget(conduct):
    """No joint is held, rubbed or leans on a limit."""
    for k in range(len(conduct)):
        conduct[k].mode = FREE
        conduct[k].spring = conduct[k].depth = 0.0


@entry_kernel(ROBOT, COUNT, NUMBER, COUNT, VECTOR, sweeps.WRENCHES, FLAG, nogil=True)
def advance(address, order, h, steps, tau, wrenches, in_world):
    """`steps` steps of the simulation at an address, in place; on failure the state before the failing step is left."""
    simulation, load = simulation_at(address), Load(tau, wrenches, in_world)
    system, memory, conduct = system_of(simulation), memory_of(simulation), conduct_of(simulation)
    joints, bounds, work = system.joints, system.bounds, system.work
    state, last = state_of(simulation), last_of(simulation)
    q, qd, nu = state
    rubs = False
    for k in range(len(qd)):
        rubs |= joints[k].friction > 0.0 or compliant(joints[k])
    copy_state(state, last)
    copy_works(simulation.done, simulation.before)
    _forget(conduct)
    sweeps.clear(memory.none)
    sweeps.clear(memory.pushed)
    status = 0
    touching = touches(bounds, q)
    if touching and steps > 0 and _is_beyond(simulation):
        status = _stop_at_limits(simulation, h)
    plain = order == 1 and system.flat and not rubs and len(wrenches) == 0
    taken = 0
    while status == 0 and taken < steps:
        if plain and not touching:
            taken += glide(simulation, h, steps - taken, tau)
            if taken == steps:
                break
        taken += 1
        copy_state(state, last)
        copy_works(simulation.done, simulation.before)
        rough = rubs or touching
        status = (
            _step_of_order_1(simulation, rough, h, load) if order == 1 else _step_of_order_4(simulation, rough, h, load)
        )
        touching = touches(bounds, q)
        if rough and not (rubs or touching):  # nothing looks at modes any more
            _forget(conduct)
    if status == 0 and order == 1 and steps > 0:
        status = sweeps.nu_from_qd(system.robot, q, qd, nu)
    energy = _kinetic(nu)
    if status == 0 and steps > 0 and not math.isfinite(energy):
        status = -1
    if status != 0:
        failing = work[status].D if status > 0 else 0.0
        _let_go(simulation)
        copy_state(last, state)
        copy_works(simulation.before, simulation.done)
        taken -= 1
        if order == 1:
            sweeps.nu_from_qd(system.robot, q, qd, nu)
        if status > 0:
            work[status].D = failing  # work to be reported
    simulation.taken += max(taken, 0)
    return status
