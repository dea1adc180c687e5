# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Balance of power over windows of time, in one pass over the states."""

from diag_dynamics.compiled.kernel import COUNT, NUMBER, entry_kernel
from diag_dynamics.compiled.tables import Table, array

BALANCE = Table(
    "Balance",
    flags=array(int),  # whether there is a state before, how many windows are written, and whether this one is whole
    stamp=array(int),  # of the state before, and of the first one in the window [ns]
    before=array(float),  # at the state before: the power of each total rate
    powers=array(float),  # and that of efforts, gravity and friction, and of all three
    begun=array(float),  # ½ν² of each total rate at the begin of the window
    work=array(float, 2),  # in the window until now: of each total rate; then of efforts, gravity and friction, in all
)
"""What is known of a window that is not over yet."""

SUMMED = Table(
    "Summed",
    stamp=array(int),  # of the states [ns]
    with_effort=array(bool),
    moved=array(bool),  # states to which no motion has led
    nu=array(float, 2),
    coriolis=array(float, 2),
    gravity=array(float, 2),
    epsilon=array(float, 2),
    friction=array(float, 2),  # without a row, if there is none
    bounds=array(int, 2),  # what comes of it: first and last stamp of each window [ns]
    windows=array(float, 2),  # see COLUMNS
    gained=array(float, 2),  # of each total rate: change of ½ν_k² over the window's length [W], and the power put to it
    explained=array(float, 2),
)
"""States of a piece, and the windows that end in it."""

COLUMNS = "kinetic", "effort", "gravity", "friction"
"""Of a window: its length's means of dK/dt, and of the powers of efforts, of gravity as it is lifted, and of friction [W]."""

HAS_STATE, WINDOWS, WHOLE = range(3)
EACH, IN_ALL = range(2)

_balance_at, _summed_at = BALANCE.opened, SUMMED.opened


@entry_kernel(COUNT, COUNT, COUNT, NUMBER, nogil=True)
def sum_windows(balance, summed, length, max_gap):
    """Sum powers over windows of a length [ns] by the trapezoidal rule; returns the number of windows that have ended.

    A window goes from the first state behind one multiple of its length to the first one behind the next, so that it does not
    matter where a recording begins. All begins anew where time did not go on, or for longer than `max_gap` [s] no state with
    efforts came; what is left of a window then is no window. The rate of ½ν_k² is ν_k(ε_k − C_k − ε_g,k − ε_fric,k), that of
    K has no C (Lemma 7.2).
    """
    own, of = _balance_at(balance), _summed_at(summed)
    flags, work, n = own.flags, own.work, len(own.begun)
    resists = len(of.friction) > 0
    flags[WINDOWS] = 0
    for t in range(len(of.stamp)):
        if of.moved[t]:
            flags[HAS_STATE] = 0
        if not of.with_effort[t]:
            continue
        now = of.stamp[t]
        elapsed = (now - own.stamp[0]) / 1e9
        if flags[HAS_STATE] == 1 and elapsed == 0.0:
            continue
        effort, gravity, friction = 0.0, 0.0, 0.0
        goes_on = flags[HAS_STATE] == 1 and 0.0 < elapsed <= max_gap
        for k in range(n):
            nu = of.nu[t, k]
            resisting = of.friction[t, k] if resists else 0.0
            effort += nu * of.epsilon[t, k]
            gravity += nu * of.gravity[t, k]
            friction += nu * resisting
            power = nu * (of.epsilon[t, k] - of.coriolis[t, k] - of.gravity[t, k] - resisting)
            if goes_on:
                work[EACH, k] += 0.5 * elapsed * (own.before[k] + power)
            else:
                work[EACH, k] = 0.0
                own.begun[k] = 0.5 * nu * nu
            own.before[k] = power
        if goes_on:
            work[IN_ALL, 0] += 0.5 * elapsed * (own.powers[0] + effort)
            work[IN_ALL, 1] += 0.5 * elapsed * (own.powers[1] + gravity)
            work[IN_ALL, 2] += 0.5 * elapsed * (own.powers[2] + friction)
        else:
            work[IN_ALL, 0] = work[IN_ALL, 1] = work[IN_ALL, 2] = 0.0
            own.stamp[1], flags[WHOLE] = now, 0
        ended = goes_on and now // length != own.stamp[0] // length
        own.powers[0], own.powers[1], own.powers[2] = effort, gravity, friction
        own.stamp[0], flags[HAS_STATE] = now, 1
        if not ended:
            continue
        if flags[WHOLE] == 1:
            w, span, gained = flags[WINDOWS], (now - own.stamp[1]) / 1e9, 0.0
            of.bounds[w, 0], of.bounds[w, 1] = own.stamp[1], now
            for k in range(n):
                change = 0.5 * of.nu[t, k] * of.nu[t, k] - own.begun[k]
                of.gained[w, k], of.explained[w, k] = change / span, work[EACH, k] / span
                gained += of.gained[w, k]
            of.windows[w, 0] = gained
            for p in range(3):
                of.windows[w, 1 + p] = work[IN_ALL, p] / span
            flags[WINDOWS] = w + 1
        for k in range(n):
            own.begun[k], work[EACH, k] = 0.5 * of.nu[t, k] * of.nu[t, k], 0.0
        work[IN_ALL, 0] = work[IN_ALL, 1] = work[IN_ALL, 2] = 0.0
        own.stamp[1], flags[WHOLE] = now, 1
    return flags[WINDOWS]
