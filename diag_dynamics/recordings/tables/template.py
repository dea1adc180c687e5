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
    columns = table.columns
    lines = [
        f"# {k:6}  {_text(column.name)}, {_text(column.sample[:1])[1:-1][:MAX_SAMPLE]}"
        for k, column in enumerate(columns)
    ]
    lines += [f"# {_text(text[:200])}" for text in table.texts]
    names = [column.name for column in columns]
    entries = [name if names.count(name) == 1 else k for k, name in enumerate(names)]
    pairs = list(zip(entries, columns, strict=True))
    times = [("time", entry) for entry, column in pairs if match_time(column)]
    proposals = times or [("time", entries[0]), ("rate", 100)]
    named = [entry for entry, column in pairs if {*column.sample[:1]} & {*joints}]
    proposals.append(("names", named) if named else ("joints", list(joints)))
    for key in QUANTITIES:
        places = [
            entry for entry, column in pairs if column.numeric and find_quantity(column.name) == key
        ]
        proposals.append((key, places or None))
    lines += ["#", *(f"# {key}: {_text(value)}" for key, value in proposals)]
    write_text(path, _HEAD.format(path=_text(table.path)) + "\n".join(lines) + "\n")


def _text(value):
    """Return a value as YAML on one line."""
    return json.dumps(value, ensure_ascii=False)
