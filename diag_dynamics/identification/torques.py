# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Errors of efforts over time, by inverse dynamics: what a fit is judged by, in no way what it is fitted by."""

import numpy as np

CUTOFF = 5.0
"""Frequency of the zero-phase filter [Hz], through which positions, rates and efforts go alike."""

ORDER = 4
"""Of the Butterworth filter that goes over the data forward and backward."""


def smoothed(t, columns, cutoff=CUTOFF):
    """Columns on evenly spaced times, through a zero-phase low-pass: (times, columns, rates of columns).

    Its gain is that of a Butterworth filter, forward and backward: 1 / (1 + (f/f_c)^2n). Ends are mirrored through their
    points, so that what goes on there does not jump.
    """
    count = len(t)
    even = np.linspace(t[0], t[-1], count)
    step = even[1] - even[0]
    values = np.column_stack([np.interp(even, t, column) for column in columns.T])
    before, after = 2.0 * values[0] - values[:0:-1], 2.0 * values[-1] - values[-2::-1]
    whole = np.concatenate([before, values, after])
    ramp = np.linspace(0.0, 1.0, len(whole))[:, None]
    trend = whole[0] + ramp * (whole[-1] - whole[0])
    frequency = np.fft.rfftfreq(len(whole), step)[:, None]
    spectrum = np.fft.rfft(whole - trend, axis=0) / (1.0 + (frequency / cutoff) ** (2 * ORDER))
    smooth = np.fft.irfft(spectrum, len(whole), axis=0) + trend
    slope = np.gradient(smooth, step, axis=0)
    return even, smooth[count - 1 : 2 * count - 1], slope[count - 1 : 2 * count - 1]
