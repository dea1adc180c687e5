# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A column map to fill in: all columns of a table, and proposals as comments."""

import json

from diag_dynamics.atomic_file import write_text
from diag_dynamics.recordings.tables.conventions import find_quantity, match_time
from diag_dynamics.recordings.tables.headers import QUANTITIES

_HEAD = """# Columns of {path}
# Remove "# " before the proposals that hold, change them, and repeat the command.
# Units are SI; a factor or a unit is an additional key: scale: {{time: ms, position: deg}}
# All keys: docs/recordings.md
#
# number  header, first value
"""

MAX_SAMPLE = 80  # characters of a first value


def write_template(path, table, joints):
    """Write the map of a Table to a new file; `joints` are the model's, empty if unknown."""
    lines = [
        f"# {k:6}  {_text(column.name)}, {_sample(column)}"
        for k, column in enumerate(table.columns)
    ]
    lines += [f"# {_text(text[:200])}" for text in table.texts]
    named = [k for k, column in enumerate(table.columns) if {*column.sample[:1]} & {*joints}]
    names = ("names", [_entry(table.columns, k) for k in named])
    proposals = [*_propose_times(table.columns), names if named else ("joints", list(joints))]
    for key in QUANTITIES:
        places = [
            k
            for k, column in enumerate(table.columns)
            if column.numeric and find_quantity(column.name) == key
        ]
        proposals.append((key, [_entry(table.columns, k) for k in places] or None))
    lines += ["#", *(f"# {key}: {_text(value)}" for key, value in proposals)]
    write_text(path, _HEAD.format(path=_text(table.path)) + "\n".join(lines) + "\n")


def _sample(column):
    """Return the beginning of the first value of a column."""
    return _text(column.sample[0][:MAX_SAMPLE] if column.sample else None)


def _text(value):
    """Return a value as YAML on one line."""
    return json.dumps(value, ensure_ascii=False)


def _propose_times(columns):
    """Return the key of each column of times, or else those of the first column and a rate."""
    times = [("time", _entry(columns, k)) for k, column in enumerate(columns) if match_time(column)]
    return times or [("time", _entry(columns, 0)), ("rate", 100)]


def _entry(columns, k):
    """Return the name of a column, or its number if several have the name."""
    names = [column.name for column in columns]
    return columns[k].name if names.count(columns[k].name) == 1 else k
