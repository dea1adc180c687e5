# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A column map to fill in: all columns of a table, and proposals as comments."""

import json
import re

from diag_dynamics.atomic_file import write_text
from diag_dynamics.recordings.tables.conventions import find_quantity, match_time
from diag_dynamics.recordings.tables.headers import QUANTITIES
from diag_dynamics.recordings.tables.table import unit_of_size

_HEAD = """# Columns of {path}
# Remove "# " before the proposals that hold, change them, and repeat the command.
# Units are SI; a factor or a unit is an additional key: scale: {{time: ms, position: deg}}
# All keys: docs/recordings.md
#
# number  header, first value
"""


def write_template(path, table, joints):
    """Write the map of a Table to a new file; `joints` are the model's, empty if unknown."""
    lines = [
        f"# {k:6}  {_text(column.name)}, {_text(column.sample[0] if column.sample else None)}"
        for k, column in enumerate(table.columns)
    ]
    lines += [f"# {_text(text[:200])}" for text in table.texts]
    proposals = [*_propose_times(table.columns), *_propose_joints(table.columns, joints)]
    for key in QUANTITIES:
        groups = _group(table.columns, key, joints) or [None]
        proposals += [(key, group) for group in groups]
    lines += ["#", *(f"# {key}: {_text(value)}" for key, value in proposals)]
    write_text(path, _HEAD.format(path=_text(table.path)) + "\n".join(lines) + "\n")


def _text(value):
    """Return a value as YAML on one line."""
    return json.dumps(value, ensure_ascii=False)


def _propose_times(columns):
    """Return keys and values of times: each such column, else the first column or a rate."""
    times = [k for k, column in enumerate(columns) if match_time(column)]
    pairs = [[k - 1, k] for k in times if k and re.search("nsec|nano", columns[k].name.lower())]
    proposals = [
        ("time", [_entry(columns, k) for k in places]) for places in [*pairs, *([k] for k in times)]
    ]
    cells = [cell for k in times for cell in columns[k].sample[:1] if cell.isdecimal()]
    units = {unit_of_size(float(cell)) for cell in cells} - {None}
    proposals += [("scale", {"time": unit}) for unit in sorted(units)]
    return proposals or [("time", [_entry(columns, 0)]), ("rate", 100)]


def _propose_joints(columns, joints):
    """Return the names of joints that first cells have, else those of the model."""
    cells = [column.sample[0] for column in columns if column.sample and not column.numeric]
    return [("joints", [cell for cell in cells if cell in joints] or list(joints))]


def _group(columns, key, joints):
    """Return lists of columns with a word of a quantity that differ in numbers or joints only."""
    groups, names = {}, "|".join(map(re.escape, sorted(joints, key=len, reverse=True))) or "(?!)"
    for k, column in enumerate(columns):
        if column.numeric and find_quantity(column.name) == key:
            pattern = re.sub(rf"{names}|\d+", "*", column.name)
            groups.setdefault(pattern, []).append(_entry(columns, k))
    return list(groups.values())


def _entry(columns, k):
    """Return the name of a column, or its number if several have the name."""
    names = [column.name for column in columns]
    return columns[k].name if names.count(columns[k].name) == 1 else k
