# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Plots of a robot's dynamics, one line each: ``dd.plot.energy(recording)``.

Each returns what it has drawn, an Axes or, where there are several panels, a Figure; matplotlib is imported when the first
one is drawn. Colours of text and axes are those of matplotlib's style, so a dark style gives a dark plot. No ROS.
"""

from diag_dynamics.plot.ellipsoids import ellipsoid
from diag_dynamics.plot.energies import energy, shares
from diag_dynamics.plot.powers import balance
from diag_dynamics.plot.torques import external_torque
from diag_dynamics.plot.trees import tree

__all__ = ["balance", "ellipsoid", "energy", "external_torque", "shares", "tree"]
