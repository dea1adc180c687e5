# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Plots of a robot's dynamics, one line each: ``dd.plot.energy(recording)``.

Each returns the Axes or, with several panels, the Figure. matplotlib is imported on first use; its
style colours text and axes.
"""

from diag_dynamics.plot.energies import balance, energy, shares
from diag_dynamics.plot.robots import ellipsoid, tree
from diag_dynamics.plot.torques import external_torque

__all__ = ["balance", "ellipsoid", "energy", "external_torque", "shares", "tree"]
