# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Base parameters: combinations of link inertias that torques depend on, and their accuracy."""

import numpy as np

from diag_dynamics.identification import inertias
from diag_dynamics.optional import require
from diag_dynamics.recordings.data_checks import jackknife
from diag_dynamics.sweeps.regressors import PARAMETERS

SYMBOLS = "m", "mx", "my", "mz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz"
# Random states, their positions [rad, m] and the deviation of their rates
STATES, REACH, RATES = 60, 1.5, 2.0
# Rounding: of a diagonal by the largest entry, of coefficients, and of values
RANK, SMALL, ZERO = 1e-9, 1e-6, 1e-12


class BaseParameters:
    """Base parameters β = E π of a robot, columns that a pivoted QR factorization keeps.

    Momentum and gravity at random states have all columns that torques have. `matrix` is E, (count,
    layout.robot), of the unknowns of a :class:`Layout`; `combinations` name each β by symbols of
    links in the axes of these links: mass, first moments, and inertias about the link's origin.
    """

    def __init__(self, layout):
        self._layout = layout
        regressors = layout.regressors
        rng = np.random.default_rng(0)
        positions = rng.uniform(-REACH, REACH, (STATES, layout.model.nq))
        rows = regressors.evaluate(positions, RATES * rng.normal(size=(STATES, layout.model.nv)))
        count = PARAMETERS * len(layout.bodies)
        free = np.flatnonzero(layout.inertial)
        Y = np.zeros((2, STATES, len(regressors.rows), layout.size))
        for k, (part, columns) in enumerate(zip(regressors.rows, regressors.columns, strict=True)):
            Y[:, :, k, columns] = np.array(rows)[:, :, part][:, :, :-1]
        self._placed, symbols = _link_axes(layout)
        R, order = require("scipy.linalg", "identify").qr(
            Y[..., :count].reshape(-1, count) @ self._placed[:, free], mode="r", pivoting=True
        )
        diagonal = np.abs(np.diag(R))
        rank = int(np.count_nonzero(diagonal > RANK * diagonal.max(initial=0.0)))
        by_rank = np.linalg.solve(R[:rank, :rank], R[:rank]) if rank else np.zeros((0, len(free)))
        by_rank[np.abs(by_rank) < SMALL] = 0.0
        rows = np.argsort(order[:rank])  # in the order of links
        by_link = np.zeros((rank, count))
        by_link[:, free[order]] = by_rank[rows]
        self.kept = free[order[:rank]][rows]
        self.combinations = [
            _name(row, column, symbols) for row, column in zip(by_link, self.kept, strict=True)
        ]
        self.matrix = np.zeros((rank, layout.robot))
        self.matrix[:, :count] = by_link @ np.linalg.pinv(self._placed)

    def describe(self, fit, fits, free):
        """Return values and standard deviations as plain values.

        A deviation is the larger of noise and of `fits` without each block, None unless inertias
        are `free`.
        """
        layout = self._layout
        E = self.matrix
        robot = fit.x[: layout.robot]
        start = layout.known[: layout.robot]
        noise = np.einsum(
            "ij,jk,ik->i", E, fit.certainty.covariance[: layout.robot, : layout.robot], E
        )
        changing = jackknife(fits[:, : layout.robot] @ E.T)
        fitted = free[: layout.robot][layout.inertial[: layout.robot]].any()
        deviations = (
            np.sqrt(np.maximum(np.maximum(noise, 0.0), changing)) if fitted else [None] * len(E)
        )
        values = [np.where(np.abs(E @ x) < ZERO, 0.0, E @ x) for x in (robot, start)]
        rows = zip(self.combinations, *values, deviations, strict=True)
        parameters = [
            {
                "name": name,
                "value": float(value),
                "model": float(model),
                "deviation": None if deviation is None else float(deviation),
            }
            for name, value, model, deviation in rows
        ]
        return {"parameters": parameters}


def _link_axes(layout):
    """Return parameters of bodies by those of links in the links' axes, and their symbols.

    Both are block by block.
    """
    count = PARAMETERS * len(layout.bodies)
    symbols = []
    placed = np.zeros((count, count))
    for k, body in enumerate(layout.bodies.tolist()):
        link = layout.model.link_names[layout.model.bodies["link"][body]]
        _, placement = layout.model.placement_in_body(link)
        placed[layout.block(k), layout.block(k)] = np.transpose(
            [inertias.moved(unit, placement) for unit in np.eye(PARAMETERS)]
        )
        symbols += [f"{symbol}({link})" for symbol in SYMBOLS]
    return placed, symbols


def _name(row, column, symbols):
    """Return a combination: the symbol of its column, then others with their coefficients."""
    terms = [f"{row[k]:+.4g} {symbols[k]}" for k in np.flatnonzero(row) if k != column]
    return " ".join([symbols[column], *terms])
