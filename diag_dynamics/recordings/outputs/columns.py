"""The columns of a piece: a quantity of each joint or link, by name, with its unit."""

import numpy as np

from diag_dynamics.recordings.analysis import Piece

PER_DOF = {
    "nu": "J^0.5",
    "xi": "rad/s, m/s",
    "epsilon": "J^0.5/s",
    "kappa": "N m, N",
    "coriolis": "J^0.5/s",
    "gravity": "J^0.5/s",
    "friction": "J^0.5/s",
    "articulated_inertia": "kg m^2, kg",
    "energy_share": "J",
}
"""Quantities of an Evaluation with an entry for each degree of freedom, and their units."""

OBSERVED = {"residual": "J^0.5/s", "external_torque": "N m, N"}

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
        names, units = model.dof_names, {"stamp": "ns", "oldest_stamp": "ns", "t": "s"}
        units |= {f"position.{name}": "rad, m" for name in model.coordinate_names}
        units |= {f"velocity.{name}": "rad/s, m/s" for name in names}
        units |= {f"effort.{name}": "N m, N" for name in names}
        self._quantities = [quantity for quantity in PER_DOF if quantity != "friction" or friction]
        for quantity in self._quantities:
            units |= {f"{quantity}.{name}": PER_DOF[quantity] for name in names}
        units |= {"kinetic_energy": "J", "base_energy": "J"}
        units |= {f"link_energy.{name}": "J" for name in model.link_names}
        units |= {"power": "W"}
        for quantity, unit in OBSERVED.items():
            units |= {f"{quantity}.{name}": unit for name in names}
        units |= {"residual_norm": "J^0.5/s", "collision": "", "stamp_is_receive_time": "", "velocity_estimated": ""}
        self.units = units

    def values(self, piece: Piece):
        """Arrays of shape (T,), in the order of :attr:`units`; NaN where something is not known."""
        states, s, (residual, torque, norm, _, collision), _ = piece
        columns = [states.newest - self._offset, states.oldest - self._offset, (states.newest - self._offset) * 1e-9]
        unknown = None if states.with_effort.all() else ~states.with_effort
        blocks = [states.position, states.velocity, states.effort]
        blocks += [getattr(s, quantity) for quantity in self._quantities]
        hidden = {3 + self._quantities.index(quantity) for quantity in OF_EFFORTS}
        for k, block in enumerate(blocks):
            columns += _each(block, unknown if k in hidden else None)
        columns += [s.kinetic_energy, s.base_energy]
        energy = np.empty((states.number, len(self._model.link_names)))
        s.write_link_energy(energy)
        columns += _each(energy)
        power = s.effort_power
        columns.append(power if unknown is None else np.where(unknown, np.nan, power))
        columns += [*_each(residual), *_each(torque), norm, collision]
        return [*columns, states.received, states.estimated]


def _each(block, unknown=None):
    """Columns of a matrix, one after the other in memory."""
    columns = np.array(block.T, order="C")
    if unknown is not None:
        columns[:, unknown] = np.nan
    return list(columns)
