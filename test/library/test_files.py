# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Written files are whole or absent, and files of parameters that were cut are rejected."""

import os
import resource
from contextlib import contextmanager

import pytest

import diag_dynamics as dd
from diag_dynamics.atomic_file import write_text

# --- Writing


@contextmanager
def full_disk(size):
    """Let no file of this process exceed `size` bytes."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_a_full_disk_keeps_the_old_file(tmp_path):
    path = tmp_path / "arm.yaml"
    path.write_text("of yesterday")
    for size in (0, 100):
        with full_disk(size), pytest.raises(dd.InputError, match=r"arm\.yaml' cannot be written"):
            dd.Parameters().save(path)
        assert path.read_text() == "of yesterday" and os.listdir(tmp_path) == ["arm.yaml"]


def test_a_file_is_on_the_disk_before_it_has_its_name(tmp_path, monkeypatch):
    """Content first, then the name; the mode of the replaced file stays."""
    path, calls, synchronize, rename = tmp_path / "arm.yaml", [], os.fsync, os.replace

    def record_fsync(descriptor):
        name = os.readlink(f"/proc/self/fd/{descriptor}")
        calls.append((name, path.read_text()))
        synchronize(descriptor)

    def record_rename(source, target):
        calls.append((str(source), str(target)))
        rename(source, target)

    monkeypatch.setattr(os, "fsync", record_fsync)
    monkeypatch.setattr(os, "replace", record_rename)
    path.write_text("old")
    path.chmod(0o640)
    write_text(path, "new")
    part = f"{path}.part"
    assert calls == [(part, "old"), (part, str(path)), (str(tmp_path), "new")]
    assert path.stat().st_mode & 0o777 == 0o640
