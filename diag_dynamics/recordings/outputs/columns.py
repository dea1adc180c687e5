# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The columns of a piece: a quantity of each joint or link, by name, with its unit."""

import numpy as np

from diag_dynamics.recordings.analysis import Piece
from diag_dynamics.sweeps.spatial import LINEAR_X, LINEAR_Y, LINEAR_Z

PER_DOF = {
    "nu": ("J^0.5", "J^0.5"),
    "xi": ("rad/s", "m/s"),
    "epsilon": ("J^0.5/s", "J^0.5/s"),
    "kappa": ("N m", "N"),
    "coriolis": ("J^0.5/s", "J^0.5/s"),
    "gravity": ("J^0.5/s", "J^0.5/s"),
    "friction": ("J^0.5/s", "J^0.5/s"),
    "articulated_inertia": ("kg m^2", "kg"),
    "energy_share": ("J", "J"),
}
"""Quantities of an Evaluation with an entry for each degree of freedom, and their units if that turns, and if it slides."""

OBSERVED = {"residual": ("J^0.5/s", "J^0.5/s"), "external_torque": ("N m", "N")}

OF_EFFORTS = {"epsilon", "kappa"}
"""Those that are unknown where an effort is."""


class Columns:
    """Names, units and values of the columns of pieces about one model.

    Parameters
    ----------
    model : RobotModel
    offset : int
        By how much stamps are later than times in the recording [ns].
    friction : bool
        Whether evaluations have it.

    Attributes
    ----------
    units : dict
        By name of the column, in their order.
    """

    def __init__(self, model, offset=0, friction=False):
        self._model, self._offset, self._friction = model, offset, friction
        names, links = model.dof_names, model.link_names
        slides = sliding(model)

        def each(quantity, turned, slid):
            return {f"{quantity}.{name}": slid if s else turned for name, s in zip(names, slides, strict=True)}

        units = {"stamp": "ns", "oldest_stamp": "ns", **_units_of_positions(model, slides)}
        units |= each("velocity", "rad/s", "m/s") | each("effort", "N m", "N")
        self._quantities = [quantity for quantity in PER_DOF if quantity != "friction" or friction]
        for quantity in self._quantities:
            units |= each(quantity, *PER_DOF[quantity])
        units |= {
            "kinetic_energy": "J",
            "base_energy": "J",
            **{f"link_energy.{link}": "J" for link in links},
            "power": "W",
        }
        for quantity, both in OBSERVED.items():
            units |= each(quantity, *both)
        units |= {"residual_norm": "J^0.5/s", "collision": "", "stamp_is_receive_time": "", "velocity_estimated": ""}
        self.units = units

    def values(self, piece: Piece):
        """Arrays of shape (T,), in the order of :attr:`units`; NaN where something is not known."""
        states, s, (residual, torque, norm, _, collision), _, _ = piece
        columns = [states.stamp - self._offset, states.oldest_stamp - self._offset]
        unknown = None if states.effort_known.all() else ~states.effort_known
        blocks = [states.position, states.velocity, states.effort]
        blocks += [getattr(s, quantity) for quantity in self._quantities]
        hidden = {3 + self._quantities.index(quantity) for quantity in OF_EFFORTS}
        for k, block in enumerate(blocks):
            columns += _each(block, unknown if k in hidden else None)
        columns += [s.kinetic_energy, s.base_energy]
        energy = np.empty((len(states), len(self._model.link_names)))
        s.write_link_energy(energy)
        columns += _each(energy)
        power = s.effort_power
        columns.append(power if unknown is None else np.where(unknown, np.nan, power))
        columns += [*_each(residual), *_each(torque), norm, collision]
        return [*columns, states.stamp_received, states.velocity_estimated]


def sliding(model):
    """Which degrees of freedom slide: the others turn."""
    bodies = model.bodies
    own = [k for k in range(1, len(bodies)) if bodies["owner"][k] == k]
    slides = np.zeros(model.nv, dtype=bool)
    slides[bodies["dof"][own]] = np.isin(bodies["direction"][own], (LINEAR_X, LINEAR_Y, LINEAR_Z))
    return slides.tolist()


def _units_of_positions(model, slides):
    """Unit of each coordinate; those of an orientation have none."""
    by_name = dict(zip(model.dof_names, slides, strict=True))
    units = {name: ("m" if by_name[name] else "rad") if name in by_name else "" for name in model.coordinate_names}
    if model.floating_base:
        units |= dict.fromkeys(model.coordinate_names[:3], "m")
    return {f"position.{name}": unit for name, unit in units.items()}


def _each(block, unknown=None):
    """Columns of a matrix, one after the other in memory."""
    columns = np.array(block.T, order="C")
    if unknown is not None:
        columns[:, unknown] = np.nan
    return list(columns)
