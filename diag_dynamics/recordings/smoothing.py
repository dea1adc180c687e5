# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Smoothed columns of a recording, through which efforts are compared with those of inverse dynamics."""

import numpy as np

CUTOFF = 5.0
"""Frequency of the zero-phase filter [Hz], through which positions, rates and efforts go alike."""

ORDER = 4
"""Of the Butterworth filter that goes over the data forward and backward."""

MEMORY = 3.0
"""Time after which the filter has forgotten all [s]: its slowest part decays by 12/s."""


def smoothed(segment, tau):
    """Positions, rates, efforts and accelerations through a zero-phase low-pass, on evenly spaced times.

    Its gain is that of a Butterworth filter, forward and backward: 1 / (1 + (f/f_c)^2n). Ends are mirrored through their
    points, so that what goes on there does not jump.

    Parameters
    ----------
    segment : Segment
        Two states or more.
    tau : ndarray, shape (T, nv)
        Instead of its efforts [N m, N].

    Returns
    -------
    q, qd, tau, qdd : ndarray
        [rad, m], [rad/s, m/s], [N m, N] and [rad/s², m/s²]; shape (T, nq) and (T, nv).
    """
    t, count = segment.t, len(segment.t)
    even = np.linspace(t[0], t[-1], count)
    step = even[1] - even[0]
    columns = np.hstack([segment.q, segment.qd, tau]).T
    values = np.stack([np.interp(even, t, column) for column in np.ascontiguousarray(columns)])
    forget = int(min(count - 1, np.ceil(MEMORY / step)))
    more = _quick(count + 2 * forget) - count
    head = min(count - 1, more // 2)
    tail = min(count - 1, more - head)
    before, after = 2.0 * values[:, :1] - values[:, head:0:-1], 2.0 * values[:, -1:] - values[:, -2 : -2 - tail : -1]
    whole = np.concatenate([before, values, after], axis=1)
    trend = whole[:, :1] + np.linspace(0.0, 1.0, whole.shape[1]) * (whole[:, -1:] - whole[:, :1])
    whole -= trend
    frequency = np.fft.rfftfreq(whole.shape[1], step)
    spectrum = np.fft.rfft(whole) / (1.0 + (frequency / CUTOFF) ** (2 * ORDER))
    smooth = np.fft.irfft(spectrum, whole.shape[1])
    smooth += trend
    nq, nv = segment.q.shape[1], segment.qd.shape[1]
    slope = np.gradient(smooth[nq : nq + nv], step, axis=1)
    within = slice(head, head + count)
    q, qd, tau = np.split(smooth[:, within], [nq, nq + nv])
    return tuple(np.ascontiguousarray(part.T) for part in (q, qd, tau, slope[:, within]))


def _quick(least):
    """The smallest number from there on that a fast Fourier transform is quick with: one of 2, 3 and 5 alone."""
    number = least
    while True:
        rest = number
        for prime in (2, 3, 5):
            while rest % prime == 0:
                rest //= prime
        if rest == 1:
            return number
        number += 1
