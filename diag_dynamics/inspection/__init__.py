# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Inspection of a robot: facts about its model, and checks of its URDF."""

from diag_dynamics.inspection.inspection_report import (
    CHECKS,
    SEVERITIES,
    Finding,
    Report,
    inspect_robot,
)

__all__ = ["CHECKS", "SEVERITIES", "Finding", "Report", "inspect_robot"]
