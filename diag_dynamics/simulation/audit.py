# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Potential energy, and the audit of energy: the work of each force and the change of what is stored."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from diag_dynamics.checks import numbers
from diag_dynamics.sweeps import classical
from diag_dynamics.sweeps import workspace as ws


def potential_energy(model, q):
    """Return the energy of the robot in the field of gravity [J], −g·Σ m_i c_i in the world's axes; q of shape (nq,)."""
    workspace, moment = ws.Workspace(model.bodies, model.gravity), np.zeros(3)
    q = numbers("q", q, (model.nq,), f"{model.nq} finite numbers")
    classical.first_moment(workspace.robot, q, moment)
    return -float(model.gravity @ moment)


class EnergyAudit(NamedTuple):
    """Work on a robot and change of its energy since it was put into its state [J].

    The work of each force is integrated by the rule that integrates the motion; the work of an impulse is the energy that
    it takes. The residual is the error of the method, and falls with the step as its order says.
    """

    effort: float
    """Work of the joint efforts, as saturated."""
    wrenches: float
    """Work of the external wrenches."""
    damping: float
    """Work of joint damping, never positive."""
    friction: float
    """Work of Coulomb friction, never positive."""
    limits: float
    """Work of position limits, without what they store: impacts and dampers, and bringing joints back to hard limits."""
    exchanged: float
    """Energy that came with another model: see :meth:`Simulation.change_model`."""
    kinetic: float
    """Change of kinetic energy."""
    potential: float
    """Change of the energy in the field of gravity."""
    elastic: float
    """Change of what compliant limits store."""

    @property
    def residual(self) -> float:
        """ΔK + ΔU + ΔE_elastic less all work [J]."""
        return sum(self[6:]) - sum(self[:6])

    def since(self, earlier: EnergyAudit) -> EnergyAudit:
        """Return the audit of the time from an earlier audit to this one."""
        return EnergyAudit(*(now - then for now, then in zip(self, earlier, strict=True)))
