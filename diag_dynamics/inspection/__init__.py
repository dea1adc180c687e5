# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the library makes of a robot: facts about it, and checks of what its URDF says."""

from diag_dynamics.inspection.findings import SEVERITIES, Finding, Report
from diag_dynamics.inspection.inspecting import CHECKS, inspect_robot

__all__ = ["CHECKS", "SEVERITIES", "Finding", "Report", "inspect_robot"]
