# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What neighbouring states of a recording say of its data, in one pass over them."""

from diag_dynamics.compiled.kernel import COUNT, NUMBER, entry_kernel
from diag_dynamics.compiled.tables import Table, array

NEIGHBOURS = Table(
    "Neighbours",
    stamp=array(int),  # of the states [ns], of which the first one is the last of the piece before, if there was one
    position=array(float, 2),
    velocity=array(float, 2),
    effort=array(float, 2),
    moved=array(bool),  # states to which no motion has led
    turns=array(bool),  # joints whose position is an angle that turns round
    whole=array(int),  # whether the window began as one
    begun=array(
        float, 2
    ),  # of each joint: its velocity when the window began, and the integrals of both since, see WINDOW
    sums=array(float, 2),  # of each joint: see SUMS
    extremes=array(float, 2),  # of each joint: largest |velocity| and |effort|, and how many states had just that
    repeated=array(int),  # states that are the one before in every bit; states of its stamp
)
"""States of a piece, and what is summed over them."""

SUMS = TRAVEL, CHANGE, APART, TOGETHER, STILL = range(5)
"""Sums over windows: of Δq², of Δq̇², of (Δq − ∫q̇dt)², and of the product of that and Δq̇; and the number of states at which
no bit of the position has changed, though the joint moves."""

WINDOW = VELOCITY, TRAVELLED, INTEGRAL = range(3)
LARGEST_VELOCITY, AT_VELOCITY, LARGEST_EFFORT, AT_EFFORT = range(4)
PI = 3.141592653589793
MOVING = 0.05
"""Speed at which a position has to change [rad/s, m/s]; as of assembly.frozen."""

_neighbours_at = NEIGHBOURS.opened


@entry_kernel(COUNT, COUNT, COUNT, NUMBER, nogil=True)
def compare_neighbours(neighbours, first, length, longest):
    """Compare each state from `first` on with the one before, and positions with velocities over windows of a length [ns].

    Windows lie as those of the balance do. They begin anew where no motion has led, and where states are more than `longest`
    apart [s].
    """
    of = _neighbours_at(neighbours)
    q, qd, tau, begun, sums, extremes = of.position, of.velocity, of.effort, of.begun, of.sums, of.extremes
    count, n = q.shape
    for t in range(first, count):
        for j in range(n):
            speed, effort = abs(qd[t, j]), abs(tau[t, j])
            if speed > extremes[LARGEST_VELOCITY, j]:
                extremes[LARGEST_VELOCITY, j], extremes[AT_VELOCITY, j] = speed, 1.0
            elif speed == extremes[LARGEST_VELOCITY, j]:
                extremes[AT_VELOCITY, j] += 1.0
            if effort > extremes[LARGEST_EFFORT, j]:
                extremes[LARGEST_EFFORT, j], extremes[AT_EFFORT, j] = effort, 1.0
            elif effort == extremes[LARGEST_EFFORT, j]:
                extremes[AT_EFFORT, j] += 1.0
        elapsed = (of.stamp[t] - of.stamp[t - 1]) / 1e9 if t > 0 else -1.0
        if t > 0:
            if elapsed == 0.0:
                of.repeated[1] += 1
            same = True
            for j in range(n):
                if q[t, j] != q[t - 1, j]:
                    same = False
                elif abs(qd[t, j]) >= MOVING:
                    sums[STILL, j] += 1.0
                same = same and qd[t, j] == qd[t - 1, j] and tau[t, j] == tau[t - 1, j]
            if same:
                of.repeated[0] += 1
        if elapsed == 0.0:
            continue
        if of.moved[t] or not 0.0 < elapsed <= longest:
            of.whole[0] = 0
            for j in range(n):
                begun[VELOCITY, j], begun[TRAVELLED, j], begun[INTEGRAL, j] = qd[t, j], 0.0, 0.0
            continue
        for j in range(n):
            step = q[t, j] - q[t - 1, j]
            if of.turns[j]:
                step = (step + PI) % (2.0 * PI) - PI
            begun[TRAVELLED, j] += step
            begun[INTEGRAL, j] += 0.5 * elapsed * (qd[t - 1, j] + qd[t, j])
        if of.stamp[t] // length == of.stamp[t - 1] // length:
            continue
        for j in range(n):
            if of.whole[0] == 1:
                change, apart = qd[t, j] - begun[VELOCITY, j], begun[TRAVELLED, j] - begun[INTEGRAL, j]
                sums[TRAVEL, j] += begun[TRAVELLED, j] * begun[TRAVELLED, j]
                sums[CHANGE, j] += change * change
                sums[APART, j] += apart * apart
                sums[TOGETHER, j] += apart * change
            begun[VELOCITY, j], begun[TRAVELLED, j], begun[INTEGRAL, j] = qd[t, j], 0.0, 0.0
        of.whole[0] = 1
