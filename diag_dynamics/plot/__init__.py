# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A plot in one line: ``dd.plot.energy(dyn.evaluate(recording.q, recording.qd), recording.t)``.

It raises InputError without states, at an array of another shape, and without matplotlib, which is
imported on first use and whose style colours text and axes.
"""

from diag_dynamics.plot.recordings import energy

__all__ = ["energy"]
