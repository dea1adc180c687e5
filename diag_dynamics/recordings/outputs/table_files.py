# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parquet and CSV: a column for each quantity of each joint and link."""

import os
from contextlib import suppress

import numpy as np

from diag_dynamics.atomic_file import AtomicFile
from diag_dynamics.model.joint_types import sliding_dofs
from diag_dynamics.optional import require

SPEED, FORCE, ROOT_POWER = ("rad/s", "m/s"), ("N m", "N"), ("J^0.5/s", "J^0.5/s")
UNITS = {
    "velocity": SPEED,
    "effort": FORCE,
    "nu": ("J^0.5", "J^0.5"),
    "xi": SPEED,
    "epsilon": ROOT_POWER,
    "kappa": FORCE,
    "coriolis": ROOT_POWER,
    "gravity": ROOT_POWER,
    "friction": ROOT_POWER,
    "articulated_inertia": ("kg m^2", "kg"),
    "energy_share": ("J", "J"),
    "residual": ROOT_POWER,
    "external_torque": FORCE,
}
"""Units of quantities per degree of freedom, of one that turns and of one that slides."""
OF_EFFORTS = "epsilon", "kappa"


class TableOutput:
    """Write the analysis of a Reading as ``parquet`` or ``csv``.

    Parquet has units in metadata and NaN, CSV units in the header and empty cells.
    """

    def __init__(self, path, reading, kind="parquet"):
        self._arrow = require("pyarrow", f"'{path}'")
        self._library = require(f"pyarrow.{kind}", f"'{path}'")
        self._reading = reading
        self._csv = kind == "csv"
        self._target = AtomicFile(path)
        self._writer = None
        self._file = None

    def write(self, piece):
        """Write a :class:`~diag_dynamics.recordings.analysis.Piece`."""
        columns = make_columns(self._reading.model, piece, self._reading.offset)
        table = self._csv_table(columns) if self._csv else self._parquet_table(columns)
        with self._target.errors():  # pyarrow does not name the file
            if self._writer is None:  # bytes, because a name may not be UTF-8
                self._file = self._arrow.OSFile(os.fsencode(self._target.name), "w")
                open_file = self._library.CSVWriter if self._csv else self._parquet_writer
                self._writer = open_file(self._file, table.schema)
            self._writer.write_table(table)

    def close(self, _summary=None):
        """Complete the file of at least one piece, and give it its name."""
        with self._target.errors():
            self._writer.close()
            self._file.close()
        self._target.commit()

    def drop(self):
        """Delete what has been written."""
        for file in filter(None, (self._writer, self._file)):
            with suppress(OSError):  # the disk may be full
                file.close()
        self._target.discard()

    def _parquet_table(self, columns):
        """Return the table of a piece; fields that cannot be null save a sixth of the time."""
        arrow = self._arrow
        model = self._reading.model
        arrays = [arrow.array(values, from_pandas=False) for _, _, values in columns]
        fields = [
            arrow.field(name, array.type, False, {"unit": unit} if unit else None)
            for (name, unit, _), array in zip(columns, arrays, strict=True)
        ]
        dofs = " ".join(model.dof_names)
        about = {"robot": model.name, "written_by": "diag_dynamics", "dof_names": dofs}
        return arrow.Table.from_arrays(arrays, schema=arrow.schema(fields, metadata=about))

    def _parquet_writer(self, file, schema):
        """Return a writer; statistics are those of scalars, because all would cost a tenth more."""
        is_floating = self._arrow.types.is_floating
        return self._library.ParquetWriter(
            file,
            schema,
            compression="snappy",
            use_dictionary=False,
            use_byte_stream_split=[field.name for field in schema if is_floating(field.type)],
            write_statistics=[name for name in schema.names if "." not in name],
        )

    def _csv_table(self, columns):
        names = [f"{name} [{unit}]" if unit else name for name, unit, _ in columns]
        arrays = [self._arrow.array(values, from_pandas=True) for _, _, values in columns]
        return self._arrow.Table.from_arrays(arrays, names=names)


def make_columns(model, piece, offset):
    """Return name, unit and values, shape (T,), of each column of a piece."""
    states, s, (residual, torque, norm, _) = piece[:3]
    slides = dict(zip(model.dof_names, sliding_dofs(model), strict=True))
    columns = [
        ("stamp", "ns", states.stamp - offset),
        ("oldest_stamp", "ns", states.oldest_stamp - offset),
    ]

    def add_block(quantity, block, units):
        contiguous = np.array(block.T, order="C")
        if quantity in OF_EFFORTS and not states.effort_known.all():
            contiguous[:, ~states.effort_known] = np.nan
        for (name, unit), values in zip(units.items(), contiguous, strict=True):
            columns.append((f"{quantity}.{name}", unit, values))

    units = {}  # those of an orientation are empty
    for k, name in enumerate(model.coordinate_names):
        is_length = slides.get(name) or (model.floating_base and k < 3)
        units[name] = "m" if is_length else "rad" if name in slides else ""
    add_block("position", states.position, units)
    others = {"velocity": states.velocity, "effort": states.effort}
    others |= {"residual": residual, "external_torque": torque}
    for quantity, pair in UNITS.items():
        if model.has_friction or quantity != "friction":
            block = others[quantity] if quantity in others else getattr(s, quantity)
            add_block(quantity, block, {name: pair[slide] for name, slide in slides.items()})
    columns += [("kinetic_energy", "J", s.kinetic_energy), ("base_energy", "J", s.base_energy)]
    add_block("link_energy", s.link_energy, dict.fromkeys(model.link_names, "J"))
    columns.append(("power", "W", np.where(states.effort_known, s.effort_power, np.nan)))
    columns += [("residual_norm", "J^0.5/s", norm), ("collision", "", piece.judged.alarm)]
    columns.append(("stamp_is_receive_time", "", states.stamp_received))
    return [*columns, ("velocity_estimated", "", states.velocity_estimated)]
