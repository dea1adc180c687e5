# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Written files are whole or absent, and files of parameters that were cut are rejected."""

import codecs
import math
import os
import resource
from contextlib import contextmanager

import numpy as np
import pytest

import diag_dynamics as dd
from diag_dynamics.atomic_file import write_text
from diag_dynamics.parameters.files import parameters_of
from diag_dynamics.parameters.monitor import PARAMETERS, Settings
from diag_dynamics.recordings.tables.column_map import read_column_map
from diag_dynamics.yaml_files import yaml_text

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
    path = tmp_path / "arm.yaml"
    calls = []
    synchronize = os.fsync
    rename = os.replace

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


# --- Files of parameters


def test_a_truncated_file_of_parameters_is_rejected(tmp_path):
    """At any length; the whole file and one without both marks are read."""
    rng = np.random.default_rng(1)
    path = tmp_path / "arm.yaml"
    values = np.exp(rng.normal(size=(6, 3))).tolist()
    joints = {f"joint{k}": dd.JointParameters(*x) for k, x in enumerate(values)}
    saved = dd.Parameters(joints)
    saved.save(path)
    whole = path.read_bytes()
    cuts = [whole[:size] for size in range(len(whole))]
    for cut in (*cuts, codecs.BOM_UTF8 + whole[: whole.rindex(b"#")]):
        path.write_bytes(cut)
        with pytest.raises(dd.InputError, match=r"arm\.yaml'"):
            dd.Parameters.load(path)
    path.write_text(yaml_text(saved.to_dict()))
    assert dict(dd.Parameters.load(path).joints) == joints
    path.write_text(whole.decode().replace("joints: 6", "joints: 5"))
    with pytest.raises(dd.InputError, match=r"joints: 5.*expected.*joints: 6"):
        dd.Parameters.load(path)


def test_a_truncated_file_of_thresholds_is_rejected(tmp_path):
    """At any length but without the last newline: it lacks thresholds or a gain, or has an open
    brace.
    """
    path = tmp_path / "alarms.yaml"
    trust = {"requested": 1.0, "duration": 9.0, "alarms": 0}
    trust |= {"held_out": 0, "method": "tail", "peaks": 9, "gain": 30.0, "friction": False}
    noise = {"names": ("a", "b"), "covariance": np.diag([2.5, 12.5])}
    saved = dd.Calibration(limits={"a": 12.5, "b": 2.25, "norm": 1.5}, **trust, **noise)
    saved.save(path)
    whole = path.read_bytes()
    defaults = {name: spec.default for name, spec in PARAMETERS.items()}

    def limits():
        observation = Settings.of(defaults | parameters_of([path])).observation
        return observation.collision.of_names(["a", "b"]) if observation else None

    assert limits().tolist() == [12.5, 2.25, math.inf, 1.5]
    for size in range(len(whole) - 1):
        path.write_bytes(whole[:size])
        with pytest.raises(
            dd.InputError, match=r"alarms\.yaml'|gain is 0|collision\.threshold|collision\.release"
        ):
            limits()


@pytest.mark.parametrize("read", [lambda path: parameters_of([path]), dd.Parameters.load])
def test_keys_are_there_once(tmp_path, read):
    path = tmp_path / "x.yaml"
    path.write_text("joints: {a: {damping: 1}}\njoints: {a: {damping: 2}}")
    with pytest.raises(dd.InputError, match=r"x\.yaml' is no YAML: key 'joints' is there 2 times"):
        read(path)


def test_parameters_are_there_once(tmp_path):
    """With dots or as groups."""
    path = tmp_path / "x.yaml"
    names = "{energy: {warn: [a=1]}, energy.warn: [a=2]}"
    path.write_text(f"/**: {{ros__parameters: {names}}}")
    with pytest.raises(dd.InputError, match=r"x\.yaml': 'energy\.warn' is there 2 times"):
        parameters_of([path])


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("a:\n  b: {c: 1.0, d", "line 2, column"),
        ("a: 1\nb: 'x", "line 2, column"),
        ("a: 1\n b: 2\nc: 3\n", "line 2, column 3"),
        ("a: *b", "line 1, column"),
        ("a: \x01", "position 3"),
    ],
)
def test_torn_yaml_is_described_by_file_and_line(tmp_path, text, place):
    path = tmp_path / "x.yaml"
    path.write_text(text)
    with pytest.raises(dd.InputError, match=rf"x\.yaml' is no YAML: .*{place}"):
        read_column_map(path)


def test_empty_files_are_rejected(tmp_path):
    """They would mean no loops, or columns by their names."""
    path = tmp_path / "x.yaml"
    path.write_text("# joints:\n")
    for read in (
        dd.Parameters.load,
        lambda path: dd.load_robot("ur5", loops=path),
        lambda path: dd.read_recording("x.csv", "ur5", columns=path),
    ):
        with pytest.raises(dd.InputError, match=r"x\.yaml'? is empty; expected YAML"):
            read(path)
