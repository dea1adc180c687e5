# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Releases: sdist, wheel, site, page bundle, systemd units, containers, the set-up script, and
benchmarks.
"""

import os
import re
import shutil
import subprocess
import sys
import tarfile
from pathlib import Path

import numpy as np
import pytest
import yaml

import diag_dynamics as dd
from diag_dynamics.cli.main import COMMANDS

pytestmark = [pytest.mark.full]

ROOT = Path(__file__).parents[2]
UNITS = sorted((ROOT / "deploy" / "systemd").glob("*.service"))
BUILT = ("build", ".git", "*.egg-info", "__pycache__", ".*_cache", ".hypothesis", "node_modules")


def run(*command, **options):
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, **options)
    assert done.returncode == 0, done.stdout + done.stderr
    return done


def test_sdist_is_complete_and_the_wheel_works_without_ros(tmp_path):
    shutil.copytree(ROOT, tmp_path / "checkout", ignore=shutil.ignore_patterns(*BUILT))
    run(
        sys.executable, "-m", "build", "--no-isolation", "--outdir", tmp_path, tmp_path / "checkout"
    )
    with tarfile.open(tmp_path / f"diag_dynamics-{dd.__version__}.tar.gz") as archive:
        packed = {member.name.partition("/")[2] for member in archive.getmembers()}
    committed = {
        name
        for name in run("git", "ls-files", cwd=ROOT).stdout.splitlines()
        if (ROOT / name).is_file()
    }
    assert committed - packed == set()
    (wheel,) = tmp_path.glob("*.whl")
    site = tmp_path / "site"
    run(sys.executable, "-m", "pip", "install", "--no-deps", "-q", "--target", site, wheel)
    modules = {path.relative_to(ROOT) for path in (ROOT / "diag_dynamics").rglob("*.py")}
    assert {
        path for path in [*modules, Path("diag_dynamics/py.typed")] if not (site / path).is_file()
    } == set()
    program = (
        "import diag_dynamics as dd; print(dd.__file__, dd.load_urdf, dd.DiagonalDynamics, "
        "dd.Simulation)\n"
        "from diag_dynamics.wire.definitions import our_definitions\n"
        "assert 'diag_dynamics/msg/DiagonalizedState' in our_definitions()\n"
        "from importlib.resources import files\n"
        "assert files('diag_dynamics.recordings').joinpath('fleet.html.j2').is_file()"
    )
    clean = {"PATH": "/usr/bin", "PYTHONPATH": str(site), "NUMBA_CACHE_DIR": str(tmp_path)}
    assert str(site) in run(sys.executable, "-c", program, cwd=tmp_path, env=clean).stdout


def test_package_xml_is_valid():
    """catkin_pkg is the parser of colcon, rosdep and bloom."""
    from catkin_pkg.package import parse_package

    warnings = []
    parse_package(str(ROOT / "package.xml"), warnings=warnings).validate(warnings=warnings)
    assert warnings == []


def test_the_site_has_every_page_and_every_public_name(tmp_path):
    from sphinx.util.inventory import InventoryFile

    run(sys.executable, ROOT / "docs/site/build.py", tmp_path / "html", cwd=ROOT)
    pages = [path.relative_to(ROOT).with_suffix(".html") for path in (ROOT / "docs").rglob("*.md")]
    assert [page for page in pages if not (tmp_path / "html" / page).is_file()] == []
    titles = [
        re.search("<title>(.*)</title>", (tmp_path / "html" / page).read_text(encoding="utf-8"))[1]
        for page in pages
    ]
    assert len(set(titles)) == len(titles)
    inventory = InventoryFile.loads((tmp_path / "html" / "objects.inv").read_bytes(), uri="").data
    documented = set().union(
        *(names for kind, names in inventory.items() if kind.startswith("py:"))
    )
    assert {f"diag_dynamics.{name}" for name in dd.__all__} - documented == set()


def test_the_committed_page_is_built_from_its_sources(tmp_path):
    """`make page` writes the same files; npm fetches the packages of the lock file."""
    shutil.copytree(ROOT / "web", tmp_path / "web", ignore=shutil.ignore_patterns("node_modules"))
    run("npm", "ci", "--no-audit", "--no-fund", "--ignore-scripts", cwd=tmp_path / "web")
    run("node", "build.js", tmp_path / "static", cwd=tmp_path / "web")
    static = ROOT / "diag_dynamics" / "page" / "static"
    built = {path.name: path.read_bytes() for path in (tmp_path / "static").iterdir()}
    assert built == {path.name: path.read_bytes() for path in static.iterdir()}, "run make page"


@pytest.mark.skipif(not shutil.which("systemd-analyze"), reason="systemd-analyze is not installed")
@pytest.mark.parametrize("unit", UNITS, ids=lambda path: path.stem)
def test_systemd_accepts_the_unit(unit):
    assert run("systemd-analyze", "verify", unit).stderr == ""
    run("systemd-analyze", "security", "--offline=true", "--threshold=20", unit)


def test_deployments_start_commands_that_exist():
    started = [
        re.search(r"exec diag-dynamics (\w+)", unit.read_text(encoding="utf-8"))[1]
        for unit in UNITS
    ]
    compose = yaml.safe_load((ROOT / "deploy" / "compose.yaml").read_text(encoding="utf-8"))
    started += [service["command"][0] for service in compose["services"].values()]
    assert len(started) > 5
    assert set(started) <= set(COMMANDS)
    copied = re.findall(
        r"^COPY (\S+) ", (ROOT / "deploy" / "Dockerfile").read_text(encoding="utf-8"), re.M
    )
    assert [source for source in copied if not (ROOT / source).exists()] == []
    run("bash", "-n", ROOT / "deploy" / "entrypoint.sh")


UNREACHABLE = {
    "PIP_CONFIG_FILE": os.devnull,
    "PIP_INDEX_URL": "http://127.0.0.1:9",
    "PIP_RETRIES": "0",
    "PIP_NO_CACHE_DIR": "1",
}


@pytest.mark.parametrize(
    ("folder", "message"),
    [
        ("/proc/none", "Cannot write to '/proc/none'."),
        ("/tmp/my robots", "ROS 2 cannot build in"),
        ("", "the package index http://127.0.0.1:9 cannot be reached"),
    ],
    ids=["not writable", "blank in the path", "no network"],
)
def test_setup_reports_its_failure_in_one_line(folder, message, tmp_path):
    variables = {
        name: value
        for name, value in os.environ.items()
        if not name.startswith(("AMENT_PREFIX", "PIP_"))
    }
    variables |= UNREACHABLE | {"DIAG_DYNAMICS_BUILD": folder or str(tmp_path)}
    done = subprocess.run(
        [ROOT / "scripts" / "setup"], env=variables, capture_output=True, text=True
    )
    assert done.returncode == 1
    (line,) = (line for line in done.stderr.splitlines() if " … " not in line)  # of progress
    assert message in line


def test_setup_shows_the_share_of_each_build():
    line = re.search(r"^done_of\(\).*", (ROOT / "scripts" / "setup").read_text(), re.MULTILINE)[0]
    for log in ("[ 50%] Building", "   50 %  sweeps.batch"):
        assert run("bash", "-c", f"{line}; done_of <(echo '{log}')").stdout == " 50 %\n"


def test_a_checkout_with_a_blank_in_its_path_builds_in_the_cache():
    """CMake's macros of ROS 2 break at a blank."""
    for checkout, built in (
        ("/home/me/dd", "/home/me/dd/build"),
        ("/home/me/my dd", "/home/me/.cache/diag_dynamics_builds/"),
    ):
        script = f"dd_root='{checkout}'; . '{ROOT}/scripts/choose_ros.bash'; echo \"$dd_built\""
        environment = {"PATH": os.environ["PATH"], "HOME": "/home/me"}
        assert run("bash", "-c", script, env=environment).stdout.startswith(built)


# --- Benchmarks in their short form: outputs are compared before anything is measured ---

BENCHMARKS = ROOT / "benchmarks"
WRITTEN = {
    "library": {"table.md", "dof.png", "growth.png", "batch.png"},
    "alarms": {"alarms.md"},
    "contact": {"contacts.md", "contact_limit.md"},
    "energy": {"energy_limit.md"},
    "nodes": {"nodes.md", "nodes_latency.png", "nodes_rates.png"},
}


def run_benchmarks(folder, *arguments):
    path = os.pathsep.join(
        [str(BENCHMARKS.parent), str(BENCHMARKS), os.environ.get("PYTHONPATH", "")]
    )
    command = [sys.executable, *map(str, arguments)]
    return subprocess.run(
        command, cwd=folder, env=os.environ | {"PYTHONPATH": path}, capture_output=True, text=True
    )


@pytest.mark.live
@pytest.mark.ros
@pytest.mark.parametrize("part", WRITTEN)
def test_short_form_writes_results(part, ros_domain, tmp_path, compiled):
    done = run_benchmarks(
        tmp_path, BENCHMARKS / "run.py", "--short", "--only", part, "--output", tmp_path / "results"
    )
    assert done.returncode == 0, done.stderr
    assert WRITTEN[part] <= {path.name for path in (tmp_path / "results").iterdir()}
    assert part != "library" or re.search(r"outputs of \d+ robots agree to \de-\d\d", done.stderr)


def test_outputs_agree_within_a_tolerance(monkeypatch):
    monkeypatch.syspath_prepend(BENCHMARKS)
    from agreement import TOLERANCE, DisagreementError, compare

    x = np.array([1.0, -2.0, 3.0])
    assert compare("robot", "x", x, x) == 0.0
    assert compare("robot", "x", x * (1 + 0.5 * TOLERANCE), x) > 0.0
    for wrong in (
        x * (1 + 2 * TOLERANCE),
        x[::-1],
        np.array([1.0, np.nan, 3.0]),
        x * np.inf,
        x[:2],
    ):
        with pytest.raises(DisagreementError):
            compare("robot", "x", wrong, x)
