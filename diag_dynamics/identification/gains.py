# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Gains of efforts: torque by reported unit of each joint, from known weights.

They are the weights of links and of a known payload.
"""

import numpy as np

from diag_dynamics.identification.dataset import portions
from diag_dynamics.identification.fit import Layout
from diag_dynamics.identification.normal_equations import OWN
from diag_dynamics.model import Parameters, Payload
from diag_dynamics.optional import require
from diag_dynamics.recordings.data_checks import (
    CENTRES,
    COLUMNS,
    DAMPING,
    ERRORS,
    GRAVITY,
    INERTIAL,
    EffortRelation,
    jackknife,
    remaining,
)

MAX_ERROR = 0.5  # of a gain, relative, ERRORS times its standard deviation
NEGLIGIBLE = 1e-9  # fraction of squared efforts that makes no difference


def with_known_payload(model, loaded, references, link, mass):
    """Return the model with a payload of known mass at the centre that explains efforts best.

    The efforts of `loaded` Datasets have any unit: each joint has a gain, which references without
    the payload share.
    """
    with_payload, without = (
        sum(_products(model, dataset, link, size) for dataset in datasets)
        for datasets, size in ((loaded, mass), (references, 0.0))
    )
    base = without if references else np.zeros((model.nv, 5, 5))
    efforts = with_payload[:, 4, 4] + base[:, 4, 4]

    def cost(centre):
        """Return the logarithm of what gains leave of squared efforts, the sum over joints."""
        sums = np.append(1.0, centre)
        along = with_payload[:, :4, 4] @ sums + base[:, 0, 4]
        squares = with_payload[:, :4, :4] @ sums @ sums + base[:, 0, 0]
        left = efforts - along**2 / np.maximum(squares, 1e-300)
        return np.log(np.maximum(left / efforts, NEGLIGIBLE)).sum()

    minimize = require("scipy.optimize", "identify").minimize
    starts = [*CENTRES, *-CENTRES[:3]]
    minima = [minimize(cost, start, method="BFGS") for start in starts]
    best = int(np.argmin([minimum.fun for minimum in minima]))
    payload = Payload(mass, minima[best].x, np.zeros((3, 3)))
    return model.with_parameters(Parameters(payloads={link: payload}))


def _products(model, dataset, link, mass):
    """Return products (nv, 5, 5) of columns without what resists.

    These are the torque with the payload at the link's origin, what moving it by 1 m along each
    axis adds, and the effort.
    """
    relation = EffortRelation(model, [link])
    products = 0.0
    for part in portions(dataset.segments):
        columns, tau = relation.columns(*part.columns)
        columns = np.concatenate([columns, tau.T[..., None]], axis=-1)
        products = products + columns.transpose(0, 2, 1) @ columns
    units = np.eye(products.shape[-1])
    loads = units[COLUMNS:-1]
    base = units[GRAVITY] + units[INERTIAL] + mass * loads[-1]
    moves = mass * (loads[:-1] - loads[-1]) / CENTRES.max()
    return remaining(products, np.vstack([base, moves, units[-1]]), units[DAMPING:COLUMNS])


def find_gains(pairs):
    """Return torque by unit of effort and its standard deviation by joint, (2, nv).

    `pairs` are models and Datasets. NaN is where gravity does not show the gain. Inertia shows
    none, because it may be a rotor's.
    """
    relations = [dataset.relate_efforts(model) for model, dataset in pairs]
    factors = np.array([relation.factor for relation in relations])
    errors = np.array([relation.error for relation in relations])
    usable = np.isfinite(factors) & np.array([relation.heavy for relation in relations])
    weights = np.where(usable, 1.0 / np.maximum(errors, 1e-300) ** 2, 0.0)
    with np.errstate(all="ignore"):
        factor = (weights * np.nan_to_num(factors)).sum(axis=0) / weights.sum(axis=0)
        error = 1.0 / np.sqrt(weights.sum(axis=0))
        gains = np.where(ERRORS * error < MAX_ERROR * np.abs(factor), 1.0 / factor, np.nan)
        return np.array([gains, np.abs(gains) * error / np.abs(factor)])


def correct_gains(model, data):
    """Correct the gains of FitData by its filtered rows, whose friction is exact.

    Their deviations are those of the jackknife.
    """
    layout = Layout(model, data.regressors)
    whole = data.fitted
    slope = _slopes(layout, whole)
    left_out = np.array([_slopes(layout, whole - block) for block in data.blocks])
    gains = data.gains[0] / slope
    data.left_out_gains = slope / left_out
    deviations = np.abs(gains / slope) * np.sqrt(jackknife(left_out))
    data.gains = np.array([gains, deviations])
    return 1.0 / slope


def _slopes(layout, sums):
    """Return slopes of efforts over the model's torque beside friction of all kinds.

    An unknown slope is 1.
    """
    slopes = np.ones(layout.model.nv)
    for k, products in enumerate(sums[:-1]):
        columns = layout.regressors.columns[k]
        is_inertial = np.isin(columns, np.flatnonzero(layout.inertial))
        torque = np.where(is_inertial, layout.known[columns], 0.0)
        rows = np.vstack([torque, np.eye(len(columns))[-len(OWN) :]])
        inner = rows @ products[:-1, :-1] @ rows.T
        right = rows @ products[:-1, -1]
        scale = 1.0 / np.sqrt(np.maximum(np.diag(inner), 1e-300))
        solution = np.linalg.lstsq(inner * scale[:, None] * scale, scale * right, rcond=1e-9)[0]
        slope = scale[0] * solution[0]
        slopes[k] = slope if slope > 0.0 else 1.0
    return slopes


def effort_scale(model, gains):
    """Return effort by reported unit, by joint.

    It is NaN where gravity shows no gain and the model has none.
    """
    before = model.effort_scale
    pairs = zip(model.dof_names, gains.tolist(), strict=True)
    return {
        name: before.get(name, 1.0) * gain if gain == gain else before.get(name, gain)
        for name, gain in pairs
    }


def gains_by_joint(names, gains):
    """Return gain and standard deviation of each joint's effort.

    A joint has None where gravity does not show them.
    """
    pairs = zip(names, *gains.tolist(), strict=True)
    return {name: [gain, error] if np.isfinite(gain) else None for name, gain, error in pairs}
