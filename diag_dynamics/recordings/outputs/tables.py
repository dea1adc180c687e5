# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parquet and CSV: a column for each quantity of each joint and link."""

import os
from contextlib import suppress

import numpy as np

from diag_dynamics.exceptions import InputError
from diag_dynamics.model.single_joints import sliding_dofs
from diag_dynamics.optional import require
from diag_dynamics.recordings.atomic_file import AtomicFile

STATE = {"velocity": ("rad/s", "m/s"), "effort": ("N m", "N")}
EVALUATED = {
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
OBSERVED = {"residual": ("J^0.5/s", "J^0.5/s"), "external_torque": ("N m", "N")}
"""Quantities per degree of freedom, with the units of one that turns and of one that slides."""


class TableOutput:
    """Writes an analysis into a table, piece by piece.

    Parquet has units in the metadata of fields and NaN for what is unknown, CSV units in the header
    (``nu.joint1 [J^0.5]``) and empty fields.

    Parameters
    ----------
    path : str or Path
    reading : Reading
    friction : bool
        Whether evaluations have friction.
    kind : str
        ``"parquet"`` or ``"csv"``.

    Raises
    ------
    InputError
        pyarrow is not installed, or the file cannot be written.
    """

    def __init__(self, path, reading, friction=False, kind="parquet"):
        self._arrow, self._library = (require(name, f"'{path}'") for name in ("pyarrow", f"pyarrow.{kind}"))
        self._reading, self._friction, self._csv = reading, friction, kind == "csv"
        self._units = column_units(reading.model, friction)
        self._target, self._writer, self._file = AtomicFile(path), None, None

    def write(self, piece):
        """Write a :class:`~diag_dynamics.recordings.analysis.Piece`."""
        model, offset = self._reading.model, self._reading.offset
        values = column_values(model, piece, offset, self._friction)
        table = self._csv_table(values) if self._csv else self._parquet_table(values)
        try:
            if self._writer is None:  # bytes, because a name may not be UTF-8
                self._file = self._arrow.OSFile(os.fsencode(self._target.name), "w")
                open_file = self._library.CSVWriter if self._csv else self._parquet_writer
                self._writer = open_file(self._file, table.schema)
            self._writer.write_table(table)
        except BrokenPipeError:  # | head
            raise
        except OSError as error:  # pyarrow does not name the file
            raise InputError(f"'{self._target.path}' cannot be written: {error}.") from error

    def close(self, _summary=None):
        """Complete the file and give it its name; raise InputError if there was no state."""
        if self._writer is None:
            raise InputError(f"'{self._target.path}' is not written: the recording has no states.")
        self._writer.close()
        self._file.close()
        self._target.commit()

    def drop(self):
        """Delete what has been written."""
        for one in filter(None, (self._writer, self._file)):
            with suppress(OSError):  # the disk may be full
                one.close()
        self._target.discard()

    def _parquet_table(self, values):
        """Return the table of a piece; fields that cannot be null save a sixth of the time."""
        arrow, model = self._arrow, self._reading.model
        arrays = [arrow.array(column, from_pandas=False) for column in values]
        fields = [
            arrow.field(name, array.type, False, {"unit": unit} if unit else None)
            for (name, unit), array in zip(self._units.items(), arrays, strict=True)
        ]
        dofs = " ".join(model.dof_names)
        about = {"robot": model.name, "written_by": "diag_dynamics", "dof_names": dofs}
        return arrow.Table.from_arrays(arrays, schema=arrow.schema(fields, metadata=about))

    def _parquet_writer(self, file, schema):
        """Return a writer; statistics are those of scalars, because all would cost a tenth more."""
        is_floating, options = self._arrow.types.is_floating, {"compression": "snappy"}
        options["use_dictionary"] = False
        options["use_byte_stream_split"] = [one.name for one in schema if is_floating(one.type)]
        options["write_statistics"] = [name for name in schema.names if "." not in name]
        return self._library.ParquetWriter(file, schema, **options)

    def _csv_table(self, values):
        names = [f"{name} [{unit}]" if unit else name for name, unit in self._units.items()]
        masks = [np.isnan(column) if column.dtype.kind == "f" else None for column in values]
        arrays = [self._arrow.array(x, mask=mask) for x, mask in zip(values, masks, strict=True)]
        return self._arrow.Table.from_arrays(arrays, names=names)


def column_units(model, friction=False):
    """Return the unit of each column by its name, in the order of the columns."""
    slides = dict(zip(model.dof_names, sliding_dofs(model), strict=True))

    def per_dof(quantities):
        return {f"{q}.{dof}": both[s] for q, both in quantities.items() for dof, s in slides.items()}

    units = {"stamp": "ns", "oldest_stamp": "ns"}
    for k, name in enumerate(model.coordinate_names):  # those of an orientation have no unit
        is_length = slides.get(name) or (model.floating_base and k < 3)
        units[f"position.{name}"] = "m" if is_length else "rad" if name in slides else ""
    units |= per_dof(STATE) | per_dof({name: EVALUATED[name] for name in _evaluated(friction)})
    units |= {"kinetic_energy": "J", "base_energy": "J"}
    units |= {f"link_energy.{link}": "J" for link in model.link_names} | {"power": "W"}
    units |= per_dof(OBSERVED) | {"residual_norm": "J^0.5/s"}
    return units | dict.fromkeys(("collision", "stamp_is_receive_time", "velocity_estimated"), "")


def column_values(model, piece, offset=0, friction=False):
    """Return the columns of a piece, each of shape (T,), in the order of :func:`column_units`."""
    states, s, (residual, torque, norm, _, collision) = piece[:3]
    unknown = None if states.effort_known.all() else ~states.effort_known
    columns = [states.stamp - offset, states.oldest_stamp - offset]
    for block in (states.position, states.velocity, states.effort):
        columns += _split(block)
    for name in _evaluated(friction):
        columns += _split(getattr(s, name), unknown if name in ("epsilon", "kappa") else None)
    link_energy = np.empty((len(states), len(model.link_names)))
    s.write_link_energy(link_energy)
    power = s.effort_power if unknown is None else np.where(unknown, np.nan, s.effort_power)
    columns += [s.kinetic_energy, s.base_energy, *_split(link_energy), power]
    columns += [*_split(residual), *_split(torque), norm, collision, states.stamp_received]
    return [*columns, states.velocity_estimated]


def _evaluated(friction):
    return [name for name in EVALUATED if name != "friction" or friction]


def _split(block, unknown=None):
    """Return the columns of a matrix, each contiguous; NaN in rows that are unknown."""
    columns = np.array(block.T, order="C")
    if unknown is not None:
        columns[:, unknown] = np.nan
    return list(columns)
