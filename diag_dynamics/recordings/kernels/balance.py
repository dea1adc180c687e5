"""Balance of power over windows of time, in one pass over the states."""

from diag_dynamics.compiled.kernel import COUNT, NUMBER, entry_kernel
from diag_dynamics.compiled.tables import Table, array

BALANCE = Table(
    "Balance",
    flags=array(int),  # whether there is a state before, and how many windows are written
    time=array(float),  # of the state before, and of the first one in the window [s]
    before=array(float),  # at the state before: the power of each total rate
    powers=array(float),  # and that of efforts, gravity and friction, and of all three
    begun=array(float),  # ½ν² of each total rate at the begin of the window
    work=array(float, 2),  # in the window until now: of each total rate; then of efforts, gravity and friction, in all
)
"""What is known of a window that is not over yet."""

SUMMED = Table(
    "Summed",
    time=array(float),  # of the states [s]
    with_effort=array(bool),
    moved=array(bool),  # states to which no motion has led
    nu=array(float, 2),
    coriolis=array(float, 2),
    gravity=array(float, 2),
    epsilon=array(float, 2),
    friction=array(float, 2),  # without a row, if there is none
    windows=array(float, 2),  # what comes of it; see COLUMNS
    gained=array(float, 2),  # of each total rate: change of ½ν_k² over the window's length [W], and the power put to it
    explained=array(float, 2),
)
"""States of a piece, and the windows that end in it."""

COLUMNS = "begin", "end", "kinetic", "effort", "gravity", "friction"
"""Of a window: its first and last time [s]; its length's means of dK/dt, and of the powers of efforts, of gravity as it is
lifted, and of friction [W]."""

ROUNDING = 0.5e-9
"""Half of a stamp's unit [s]: times that are exact in nanoseconds are not in doubles."""

HAS_STATE, WINDOWS = range(2)
EACH, IN_ALL = range(2)

_balance_at, _summed_at = BALANCE.opened, SUMMED.opened


@entry_kernel(COUNT, COUNT, NUMBER, NUMBER, nogil=True)
def sum_windows(balance, summed, length, max_gap):
    """Sum powers over windows of a length [s] by the trapezoidal rule; returns the number of windows that have ended.

    A window begins anew where time did not go on, or for longer than `max_gap` no state with efforts came. The rate of ½ν_k²
    is ν_k(ε_k − C_k − ε_g,k − ε_fric,k), that of K has no C (Lemma 7.2).
    """
    own, of = _balance_at(balance), _summed_at(summed)
    flags, work, n = own.flags, own.work, len(own.begun)
    resists = len(of.friction) > 0
    flags[WINDOWS] = 0
    for t in range(len(of.time)):
        if of.moved[t]:
            flags[HAS_STATE] = 0
        if not of.with_effort[t]:
            continue
        now = of.time[t]
        elapsed = now - own.time[0]
        if flags[HAS_STATE] == 1 and elapsed == 0.0:
            continue
        effort, gravity, friction = 0.0, 0.0, 0.0
        goes_on = flags[HAS_STATE] == 1 and 0.0 < elapsed <= max_gap + ROUNDING
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
            own.time[1] = now
        own.powers[0], own.powers[1], own.powers[2] = effort, gravity, friction
        own.time[0], flags[HAS_STATE] = now, 1
        span = now - own.time[1]
        if span < length - ROUNDING:
            continue
        w = flags[WINDOWS]
        of.windows[w, 0], of.windows[w, 1] = own.time[1], now
        gained = 0.0
        for k in range(n):
            share = 0.5 * of.nu[t, k] * of.nu[t, k]
            of.gained[w, k], of.explained[w, k] = (share - own.begun[k]) / span, work[EACH, k] / span
            gained += of.gained[w, k]
            own.begun[k], work[EACH, k] = share, 0.0
        of.windows[w, 2] = gained
        for p in range(3):
            of.windows[w, 3 + p] = work[IN_ALL, p] / span
            work[IN_ALL, p] = 0.0
        own.time[1] = now
        flags[WINDOWS] = w + 1
    return flags[WINDOWS]
