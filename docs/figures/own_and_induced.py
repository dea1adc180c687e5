# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Own rate and induced rate: an arm whose shoulder turns, and what its free joints would do by themselves."""

import numpy as np
from rods import model, points
from style import COLOURS, INK, figure

import diag_dynamics as dd

POSTURE = np.array([0.4, 0.9, 0.5])
"""Of the arm [rad]."""

MOMENT = 0.25
"""For which the rates are drawn on [s]."""


def data():
    """Return rates (3,) [rad/s] with the outer joints held and with them free, and ξ (3,) [rad/s] of both."""
    dynamics = dd.DiagonalDynamics(model())
    held = np.array([1.0, 0.0, 0.0])
    root = np.sqrt(dynamics.factors(POSTURE).D)
    nu = dynamics.nu_from_qd(POSTURE, held)
    free = dynamics.qd_from_nu(POSTURE, np.array([nu[0], 0.0, 0.0]))  # that of joint 1 alone
    return held, free / free[0], nu / root, dynamics.nu_from_qd(POSTURE, free / free[0]) / root


def draw():
    """Return the figure."""
    held, free, total_held, total_free = data()
    picture = figure(6.6, 3.0)
    cases = (("joints 2 and 3 held", held, total_held), ("joints 2 and 3 free", free, total_free))
    for axes, (name, rates, total) in zip(
        picture.subplots(1, 2, sharex=True, sharey=True), cases, strict=True
    ):
        for part, alpha in ((0.0, 1.0), (0.5, 0.35), (1.0, 0.6)):
            place = points(POSTURE + part * MOMENT * rates)
            axes.plot(
                *place.T,
                color=INK,
                alpha=alpha,
                linewidth=3.0 if part == 0.0 else 1.4,
                solid_capstyle="round",
            )
            if part in (0.0, 1.0):
                for k in range(3):
                    axes.plot(*place[k], "o", color=COLOURS[k], alpha=alpha, markersize=6)
        said = "\n".join(
            f"q̇{n} = {r:+.2f}   ξ{n} = {x:+.2f}"
            for n, r, x in zip("₁₂₃", rates, total, strict=True)
        )
        axes.text(0.0, -0.12, said, va="top")
        axes.set_title(name)
        axes.set_aspect("equal")
        axes.set(xlim=(-0.05, 0.75), ylim=(-0.45, 1.0))
        axes.set_axis_off()
    return picture
