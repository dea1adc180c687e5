# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Files of deploy/: systemd, the shell and YAML take them, and what they start exists."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest
import yaml

from diag_dynamics.cli.main import COMMANDS

pytestmark = [pytest.mark.full]

ROOT = Path(__file__).parents[2]
DEPLOY = ROOT / "deploy"
UNITS = sorted((DEPLOY / "systemd").glob("*.service"))


@pytest.mark.parametrize("unit", UNITS, ids=lambda path: path.stem)
def test_systemd_takes_the_unit(unit):
    """Without a word, and it has limits."""
    if not shutil.which("systemd-analyze"):
        pytest.skip("systemd-analyze is not installed")
    done = subprocess.run(["systemd-analyze", "verify", unit], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0 and not done.stderr.strip(), done.stderr
    said = dict(re.findall(r"^(\w+)=(.*)$", unit.read_text(encoding="utf-8"), re.M))
    assert {"MemoryMax", "TasksMax", "StartLimitBurst", "NoNewPrivileges", "TimeoutStopSec"} <= set(said)
    (node,) = re.findall(r"exec diag-dynamics (\w+) --ros-args", said["ExecStart"])
    assert node in COMMANDS and node in unit.name
    assert said["Restart"] == ("no" if node == "controller" else "on-failure")
    assert ("CPUQuota" in said) == (node != "controller")  # an arm does not go without commands for want of a share


@pytest.mark.parametrize("unit", UNITS, ids=lambda path: path.stem)
def test_systemd_finds_little_exposed(unit):
    """By its own measure, whose threshold is 20 tenths; units that say nothing have more than 90."""
    if not shutil.which("systemd-analyze"):
        pytest.skip("systemd-analyze is not installed")
    command = ["systemd-analyze", "security", "--offline=true", "--threshold=20", unit]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    if "unrecognized option" in done.stderr:
        pytest.skip("systemd is older than 250")
    assert done.returncode == 0, done.stdout[-200:]


def test_systemd_can_refuse(tmp_path):
    """The test before this one can fail."""
    if not shutil.which("systemd-analyze"):
        pytest.skip("systemd-analyze is not installed")
    wrong = tmp_path / UNITS[0].name
    wrong.write_text(UNITS[0].read_text(encoding="utf-8").replace("TimeoutStopSec=5", "TimeoutStopSec=soon"))
    done = subprocess.run(["systemd-analyze", "verify", wrong], capture_output=True, text=True, timeout=60)
    assert "Failed to parse time value" in done.stderr


def test_compose_starts_what_there_is():
    """Robot, monitor and a view, by commands of diag-dynamics, each with limits and without rights."""
    compose = yaml.safe_load((DEPLOY / "compose.yaml").read_text(encoding="utf-8"))
    assert set(compose["services"]) == {"robot", "monitor", "page"}
    for name, service in compose["services"].items():
        assert service["command"][0] in COMMANDS, name
        assert service["mem_limit"] and service["cap_drop"] == ["ALL"] and service["read_only"]
        assert set(service.get("depends_on", ())) <= set(compose["services"])
        assert {volume.split(":")[0] for volume in service["volumes"]} <= {"./robot", *compose["volumes"]}
        assert (DEPLOY / service["build"]["context"] / service["build"]["dockerfile"]).is_file()


def test_the_image_copies_what_there_is():
    """Files that it copies are there, and its shell script is one."""
    text = (DEPLOY / "Dockerfile").read_text(encoding="utf-8")
    for source in re.findall(r"^COPY (\S+) ", text, re.M):
        assert (ROOT / source).exists(), source
    assert "NOT RUN" in text[:300] and "NOT RUN" in (DEPLOY / "compose.yaml").read_text(encoding="utf-8")[:300]
    left_out = re.findall(r"^[^#\s].*$", (ROOT / ".dockerignore").read_text(encoding="utf-8"), re.M)
    built = re.findall(r"^install\(DIRECTORY (.*)$", (ROOT / "CMakeLists.txt").read_text(encoding="utf-8"), re.M)
    needed = {name.strip("/") for names in built for name in names.split()} | {
        "deploy",
        "cmake",
        "msg",
        "srv",
        "scripts",
    }
    assert {"build", ".git"} <= set(left_out) and not needed & set(left_out)
    subprocess.run(["bash", "-n", DEPLOY / "entrypoint.sh"], check=True)
    assert (DEPLOY / "entrypoint.sh").stat().st_mode & 0o111
