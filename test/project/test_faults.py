# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""docs/faults.md names tests that exist, every fault has one, and every test of faults is named there."""

import ast
import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
FAULTS = ("test_faults_*.py", "test_lifecycle.py", "test_two_hosts.py", "test_restarts.py")
"""Files of which every test stands in the table."""


def functions(path):
    """Return the names of the tests in a file."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return {node.name for node in tree.body if isinstance(node, ast.FunctionDef) and node.name.startswith("test_")}


def table():
    """Return the rows of all tables, each as its cells."""
    lines = (ROOT / "docs" / "faults.md").read_text(encoding="utf-8").splitlines()
    rows = [line.strip("| ").split(" | ") for line in lines if line.startswith("| ")]
    return [row for row in rows if row[0] != "fault"]


def test_every_fault_has_a_test_that_exists():
    """Each row has four cells, and the last one nothing but tests, as file::function."""
    rows = table()
    assert len(rows) > 50
    for row in rows:
        assert len(row) == 4 and all(row), row
        named = re.findall(r"`(test_\w+\.py)::(\w+)`", row[3])
        assert named and not re.sub(r"`[^`]+`|, ", "", row[3]), row
        for file, function in named:
            (path,) = (ROOT / "test").rglob(file)
            assert function in functions(path), f"{file}::{function}"


def test_every_test_of_faults_is_named():
    """A test that is not in the table shows a fault that nobody is told of."""
    text = (ROOT / "docs" / "faults.md").read_text(encoding="utf-8")
    files = sorted(path for pattern in FAULTS for path in (ROOT / "test").rglob(pattern))
    assert files
    tests = [f"{path.name}::{name}" for path in files for name in sorted(functions(path))]
    assert not [name for name in tests if f"`{name}`" not in text]
