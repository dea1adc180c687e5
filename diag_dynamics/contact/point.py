# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A point of a link at which contact is looked at."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from diag_dynamics.arrays import PointLike, RowsLike


@dataclass(frozen=True)
class ContactPoint:
    """A point of a link, or several of which the worst counts.

    Parameters
    ----------
    name : str
        What it is called in results.
    link : str
        Name of the link.
    points : array_like, shape (3,) or (number, 3)
        From the link's origin in the link's axes [m].
    direction : array_like, shape (3,), optional
        Along which contact is looked at; by default along the motion of each point.
    frame : {"link", "root"}
        Axes of the direction.
    """

    name: str
    link: str
    points: PointLike | RowsLike = (0.0, 0.0, 0.0)
    direction: PointLike | None = None
    frame: Literal["link", "root"] = "link"
