# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The dynamics of one robot, as users call them."""

from diag_dynamics.dynamics.dynamics import DiagonalDynamics

__all__ = ["DiagonalDynamics"]
