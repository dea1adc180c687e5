# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What an inspection finds, and the report of all of it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

SEVERITIES = ("ok", "note", "warning", "error")
"""From the least on.

A note is worth knowing and may be as it was meant; a warning is very likely a mistake of the URDF, and results are computed
with it; with an error there are no results, or not of the whole robot.
"""


@dataclass(frozen=True)
class Finding:
    """One thing that a check has found.

    Attributes
    ----------
    severity : str
        One of :data:`SEVERITIES`.
    check : str
        Name of the check.
    what : str
        What is so, and why it is remarkable.
    links, joints : tuple of str
        Where.
    values : dict
        A number for each of these names, or of those that have one.
    unit : str
        Of the numbers.
    remedy : str
        What to do about it.
    """

    severity: str
    check: str
    what: str
    links: Sequence[str] = ()
    joints: Sequence[str] = ()
    values: Mapping[str, float] = field(default_factory=dict)
    unit: str = ""
    remedy: str = ""

    def to_dict(self) -> dict[str, Any]:
        """All of it by name, as JSON has it: a number that is not finite is None."""
        values = {name: float(value) if math.isfinite(value) else None for name, value in self.values.items()}
        return {
            "severity": self.severity,
            "check": self.check,
            "what": self.what,
            "links": list(self.links),
            "joints": list(self.joints),
            "values": values,
            "unit": self.unit,
            "remedy": self.remedy,
        }


@dataclass(frozen=True)
class Report:
    """All that was found of a robot.

    Attributes
    ----------
    source : str
        Where the robot comes from.
    facts : dict
        What the robot is, by name; None where there is no model to say it.
    findings : tuple of Finding
        The worst first.
    checks : dict
        The worst severity that each check has found, or "skipped" where the robot has no model that it needs.
    """

    source: str
    facts: dict[str, Any]
    findings: tuple[Finding, ...]
    checks: dict[str, str]

    @property
    def status(self) -> int:
        """Exit status: 0 where nothing is above a note, 1 where there are warnings, 2 where there are errors."""
        worst = max((SEVERITIES.index(finding.severity) for finding in self.findings), default=0)
        return max(0, worst - SEVERITIES.index("note"))

    def to_dict(self) -> dict[str, Any]:
        """All of it as JSON has it."""
        return {
            "source": self.source,
            "status": self.status,
            "facts": self.facts,
            "checks": self.checks,
            "findings": [finding.to_dict() for finding in self.findings],
        }
