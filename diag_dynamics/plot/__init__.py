# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Plots of a robot's dynamics, one line each: ``dd.plot.energy(recording)``.

Each returns the Axes or, with several panels, the Figure. Each raises InputError without states, at
a missing joint, link or robot, at an array of another shape, and without matplotlib. matplotlib is
imported on first use; its style colours text and axes.
"""

from diag_dynamics.plot.recordings import energy
from diag_dynamics.plot.robots import ellipsoid

__all__ = ["ellipsoid", "energy"]
