# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The disturbance observer over many states: its recursion, with everything but the states themselves carried on."""

import numpy as np

from diag_dynamics.compiled.kernel import COUNT, NUMBER, entry_kernel
from diag_dynamics.compiled.tables import Table, array

OBSERVER = Table(
    "Observer",
    gain=array(float),  # K_O of each component [1/s]
    residual=array(float),  # r
    nu=array(float),  # of the last sample
    resisting=array(float),
    epsilon=array(float),
    stamp=array(int),  # of the last sample [ns]
    flags=array(int),  # whether there is a last sample, whether its result is valid, and whether it is a collision
)
"""What an observer knows when it takes a state in, and then anew."""

OBSERVED = Table(
    "Observed",
    stamp=array(int),  # of the states [ns]
    with_effort=array(bool),
    moved=array(bool),  # states to which no motion has led: all begins anew
    nu=array(float, 2),
    coriolis=array(float, 2),
    gravity=array(float, 2),
    epsilon=array(float, 2),
    friction=array(float, 2),  # without a row, if it is not taken into account
    residual=array(float, 2),  # what comes of it, zero where nothing does
    norm=array(float),
    valid=array(bool),
    collision=array(bool),
)
"""States of a piece, and what is observed at them."""

HAS_SAMPLE, IS_VALID, COLLIDES = range(3)

_observer_at, _observed_at = OBSERVER.opened, OBSERVED.opened


@entry_kernel(COUNT, COUNT, NUMBER, NUMBER, NUMBER, nogil=True)
def observe_many(observer, observed, threshold, release, max_gap):
    """Observe at states one after the other, as control.observer.DisturbanceObserver does.

    A sample begins anew where time went back, or none came for longer than `max_gap`; samples of one time count once.
    """
    own, of = _observer_at(observer), _observed_at(observed)
    r, flags, n = own.residual, own.flags, len(own.residual)
    resists = len(of.friction) > 0
    for t in range(len(of.stamp)):
        if of.moved[t]:
            flags[HAS_SAMPLE] = flags[IS_VALID] = flags[COLLIDES] = 0
            for k in range(n):
                r[k] = 0.0
        valid = False
        if of.with_effort[t]:
            interval = (of.stamp[t] - own.stamp[0]) / 1e9
            again = flags[HAS_SAMPLE] == 1 and interval == 0.0
            begins = flags[HAS_SAMPLE] == 0 or interval < 0.0 or interval > max_gap
            if again:
                valid = flags[IS_VALID] == 1
            else:
                for k in range(n):
                    resisting = of.coriolis[t, k] + of.gravity[t, k]
                    if resists:
                        resisting += of.friction[t, k]
                    if begins:
                        r[k] = 0.0
                    else:
                        mean = 0.5 * (own.epsilon[k] + of.epsilon[t, k] - own.resisting[k] - resisting)
                        external = (of.nu[t, k] - own.nu[k]) / interval - mean
                        r[k] = r[k] - np.expm1(-own.gain[k] * interval) * (external - r[k])
                    own.nu[k], own.resisting[k], own.epsilon[k] = of.nu[t, k], resisting, of.epsilon[t, k]
                own.stamp[0], flags[HAS_SAMPLE] = of.stamp[t], 1
                valid = not begins
                if begins:
                    flags[COLLIDES] = 0
        norm = 0.0
        if valid:
            for k in range(n):
                norm += r[k] * r[k]
            norm = np.sqrt(norm)
            if not np.isfinite(norm):  # nor will it ever be again
                valid, norm, flags[COLLIDES] = False, 0.0, 0
                for k in range(n):
                    r[k] = 0.0
            elif flags[COLLIDES] == 1:
                flags[COLLIDES] = 1 if norm >= release else 0
            else:
                flags[COLLIDES] = 1 if norm > threshold else 0
        if of.with_effort[t]:
            flags[IS_VALID] = 1 if valid else 0
        of.valid[t], of.norm[t] = valid, norm
        of.collision[t] = valid and flags[COLLIDES] == 1
        for k in range(n):
            of.residual[t, k] = r[k] if valid else 0.0
