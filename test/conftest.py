# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tests with ROS 2: whether it is there, a domain for each file, compiled kernels, the nodes' output on failure."""

import fcntl
import os
import random
import re
import signal
import tempfile
from pathlib import Path

import pytest

try:
    import examples
except ModuleNotFoundError as error:
    pytest.exit(
        f"{error}: `make setup-tests`, or pip install '.[test]', installs what tests need.", pytest.ExitCode.USAGE_ERROR
    )

NODES = Path(__file__).parent / "nodes"
"""Folder of the files that import ROS 2 at their top, and whose tests are all marked `ros`."""

REQUIRED = os.environ.get("DIAG_DYNAMICS_REQUIRE_ROS") == "1"

BY_RCLPY = os.environ.get("DIAG_DYNAMICS_TEST_RCLPY", "").split()
"""Names of the files whose monitors take messages by rclpy, whatever the others do."""


def without_ros():
    """Why the tests with ROS 2 cannot run, or None."""
    try:
        import diag_dynamics.msg
        import diag_dynamics.srv  # noqa: F401
        import rclpy  # noqa: F401
    except ImportError as error:
        return f"no ROS 2 with diag_dynamics' interfaces ({error}): make setup, then source scripts/env.bash"
    return None


def pytest_addoption(parser):
    parser.addoption(
        "--robots", choices=("few", "all"), default="few", help="robots that the laws run over: 12 of the gate, or all"
    )


def pytest_configure(config):
    examples.select_robots(config.getoption("robots"))
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        # A shell's background job ignores Ctrl-C, and so would the processes under test.
        signal.signal(signal.SIGINT, signal.default_int_handler)


LONGEST = (
    "test_benchmarks.py",
    "test_tools.py",
    "test_kernel.py",
    "test_simulator_commands.py",
    "test_mimic.py",
    "test_page_browser.py",
    "test_physics.py",
    "test_controller_safety.py",
    "test_tutorial.py",
    "test_report.py",
    "test_faults_input.py",
    "test_simulation.py",
    "test_restarts.py",
    "test_derivatives.py",
    "test_view_node.py",
    "test_site.py",
    "test_demo.py",
    "test_packaging.py",
    "test_demo_control.py",
)
"""Files that take half a minute or more, handed out first: begun last, one of them would keep all others waiting."""


def pytest_collection_modifyitems(items):
    """Hand out the longest files first, then of each folder in turn: tests of nodes wait while those of the library compute.

    pytest-xdist keeps this order with --no-loadscope-reorder only: else it begins with the files of the most tests.
    """
    folders = {}
    for item in items:
        folders.setdefault(item.path.parent, {}).setdefault(item.path, None)
    place = {path: k / len(paths) for paths in folders.values() for k, path in enumerate(paths)}
    first = {name: k - len(LONGEST) for k, name in enumerate(LONGEST)}
    items.sort(key=lambda item: first.get(item.path.name, place[item.path]))


class RosFile(pytest.Module):
    """A test file that can be imported only where ROS 2 is."""

    def collect(self):
        reason = without_ros()
        if reason and REQUIRED:
            raise self.CollectError(f"{reason}; DIAG_DYNAMICS_REQUIRE_ROS=1 makes this a failure")
        if reason:
            pytest.skip(reason, allow_module_level=True)
        with pytest.MonkeyPatch.context() as environment:
            choose_serialization(environment, self.path)
            return super().collect()


def choose_serialization(environment, path):
    """Have monitors of a test file take messages as :data:`BY_RCLPY` says."""
    if path.name in BY_RCLPY:
        environment.setenv("DIAG_DYNAMICS_TEST_SERIALIZATION", "rclpy")


def pytest_pycollect_makemodule(module_path, parent):
    if NODES not in module_path.parents:
        return None
    file = RosFile.from_parent(parent, path=module_path)
    file.add_marker(pytest.mark.ros)
    return file


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_setupnodes(config):
    """Compile before there are workers, each of which would wait for the same, or do it again."""
    import compiling

    reporter = config.pluginmanager.get_plugin("terminalreporter")
    reporter.write_line("Compiling what tests share (two minutes, once) …")
    compiling.in_two_processes()


MAX_CPU_TIME = 10.0
"""CPU-seconds that a test of the gate may take, with the processes that it starts; wall time is that of the machine."""


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item):
    """Fail a test of the gate that takes longer than :data:`MAX_CPU_TIME`."""
    begin = sum(os.times()[:4])
    result = yield
    taken = sum(os.times()[:4]) - begin
    if taken > MAX_CPU_TIME and not item.get_closest_marker("full"):
        pytest.fail(f"the test took {taken:.1f} CPU-s; expected at most {MAX_CPU_TIME:g} in the gate. Mark it `full`.")
    return result


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item):
    """Show what the nodes have said, and what those that go on are at, where a test with nodes fails."""
    report = yield
    if report.failed and item.get_closest_marker("ros"):
        import stacks
        from nodes import Process

        for process in Process.started[-4:]:
            report.sections.append((f"output of {process}", process.tail()))
            if process.popen.poll() is None:
                known = "\n".join(map(stacks.known_of, stacks.family(process.popen.pid)))
                report.sections.append((f"what {process} is at", known))
    return report


@pytest.fixture(scope="session")
def compiled():
    """Compile the kernels once, into the cache on disk, so that nodes start in seconds."""
    import compiling

    compiling.equations()
    compiling.simulation()
    if not without_ros():
        compiling.messages()


@pytest.fixture(scope="module")
def ros_domain(request, tmp_path_factory, compiled):
    """A ROS domain that no other test run on this machine has, in this process and in those it starts.

    A file marked `kills` takes UDP. A process that is killed while it holds a lock of Fast DDS's shared memory leaves it
    locked, and those beside it wait for ever, signals and all: https://github.com/eProsima/Fast-DDS/issues/5469.
    """
    from nodes import Process

    domain, lock = lock_domain()
    with pytest.MonkeyPatch.context() as environment:
        environment.setenv("ROS_DOMAIN_ID", str(domain))
        environment.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        environment.setenv("ROS_PYTHON_CHECK_FIELDS", "1")
        environment.setenv("ROS_LOG_DIR", str(tmp_path_factory.mktemp("ros_log")))
        choose_serialization(environment, request.path)
        if request.node.get_closest_marker("kills"):
            environment.setenv("FASTDDS_BUILTIN_TRANSPORTS", "UDPv4")
        yield domain
    os.close(lock)
    Process.started.clear()


def lock_domain():
    """Lock a file that stands for a domain. The lock goes with the process, by whatever end.

    Domains with shared memory that a killed process has left come last.
    """
    for domain in sorted(random.SystemRandom().sample(range(1, 102), 101), key=left_in_shared_memory):
        path = Path(tempfile.gettempdir(), f"diag_dynamics_ros_domain_{domain}")
        try:
            lock = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
        except PermissionError:  # another user's
            continue
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(lock)
            continue
        return domain, lock
    raise RuntimeError("all ROS domains from 1 to 101 are taken by other test runs")


def left_in_shared_memory(domain):
    """How many of Fast DDS's ports of a domain have a file in shared memory, where Linux has it."""
    ports = range(7400 + 250 * domain, 7400 + 250 * (domain + 1))
    files = [name for pattern in ("fastrtps_port*", "fastdds_port*") for name in Path("/dev/shm").glob(pattern)]
    return sum(int(digits[0]) in ports for file in files if (digits := re.findall(r"port(\d+)", file.name)))


@pytest.fixture(scope="module")
def peer(ros_domain):
    """A node of the test's own, to talk to the nodes under test."""
    from nodes import Peer

    with Peer(ros_domain) as node:
        yield node


@pytest.fixture
def panda():
    """Return the robot of most monitors under test."""
    from nodes import PANDA, robot

    return robot(PANDA)


@pytest.fixture
def monitor(running, panda):
    """Return the monitor that the file keeps running, all joints fresh; afterwards it must give right numbers again."""
    running.serves(panda)
    running.forget()
    yield running
    running.serves(panda, 1)
