# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tiers, kernels compiled once, and the peer of nodes under test."""

import signal
from pathlib import Path

import pytest

try:
    import examples
except ModuleNotFoundError as error:
    pytest.exit(
        f"{error}: `make setup-tests` or pip install '.[all]' --group test, installs them.",
        pytest.ExitCode.USAGE_ERROR,
    )

WITH_ROS = [Path(__file__).parent / folder for folder in ("nodes", "live")]
"""Folders of the files that import ROS 2 at their top; all their tests are marked `ros`."""


def pytest_addoption(parser):
    parser.addoption(
        "--robots",
        choices=("few", "all"),
        default="few",
        help="robots that the laws run over: 14 in the gate, or all",
    )


def pytest_configure(config):
    examples.select_robots(config.getoption("robots"))
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        # A shell's background job ignores Ctrl-C, and so would the processes under test.
        signal.signal(signal.SIGINT, signal.default_int_handler)


# --- ROS 2


def without_ros():
    """Return why the tests with ROS 2 cannot run, or None."""
    try:
        import diag_dynamics.msg
        import diag_dynamics.srv  # noqa: F401
        import rclpy  # noqa: F401
    except ImportError as error:
        return (
            f"no ROS 2 with diag_dynamics' interfaces ({error}): make setup, then source "
            f"scripts/env.bash"
        )
    return None


class RosFile(pytest.Module):
    """A test file that can be imported only where ROS 2 is."""

    def collect(self):
        if reason := without_ros():
            raise self.CollectError(f"{reason}. Without ROS 2: pytest test/library")
        return super().collect()


def pytest_pycollect_makemodule(module_path, parent):
    if not any(folder in module_path.parents for folder in WITH_ROS):
        return None
    file = RosFile.from_parent(parent, path=module_path)
    file.add_marker(pytest.mark.ros)
    return file


def pytest_make_parametrize_id(config, val):
    """Return the `id` of a robot."""
    name = getattr(val, "id", None)
    return name if isinstance(name, str) else None


# --- kernels


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_setupnodes(config):
    """Compile the largest kernels before there are workers, each of which would wait for the same,
    or do it again.

    `make setup-tests` has compiled all of them; this is for those who call pytest.
    """
    import compiling

    reporter = config.pluginmanager.get_plugin("terminalreporter")
    reporter.write_line("Compiling the kernels that tests share (a minute or two, once) …")
    compiling.in_two_processes()


@pytest.fixture(scope="session")
def compiled():
    """Compile the kernels once, into the cache on disk."""
    import compiling

    compiling.equations()
    compiling.simulation()
    if not without_ros():
        compiling.messages()


# --- nodes under test


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item):
    """Show the output of processes where a live test fails."""
    report = yield
    if report.failed and item.get_closest_marker("live"):
        from processes import Process

        report.sections += Process.report()
    return report


@pytest.fixture(scope="module")
def ros_domain(tmp_path_factory, compiled):
    """Return a ROS domain that no other test run on this machine has, in this process and in those
    that it starts.

    All go by UDP: a process that is killed while it holds a lock of Fast DDS's shared memory leaves
    it locked, and the others wait for ever, https://github.com/eProsima/Fast-DDS/issues/5469. A
    profile says so, because the discovery range LOCALHOST overrides FASTDDS_BUILTIN_TRANSPORTS.
    """
    from processes import Process, locked_domain

    with locked_domain() as domain, pytest.MonkeyPatch.context() as environment:
        environment.setenv("ROS_DOMAIN_ID", str(domain))
        environment.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET")
        profile = Path(__file__).parent / "support" / "loopback.xml"
        for library in ("FASTRTPS", "FASTDDS"):  # of Jazzy, and of Kilted
            environment.setenv(f"{library}_DEFAULT_PROFILES_FILE", str(profile))
        environment.setenv("ROS_PYTHON_CHECK_FIELDS", "1")
        environment.setenv("ROS_LOG_DIR", str(tmp_path_factory.mktemp("ros_log")))
        yield domain
    Process.started.clear()


@pytest.fixture(scope="session")
def no_discovery(compiled, tmp_path_factory):
    """Keep DDS from looking for other participants: nodes in the test's process meet on a graph of
    the test's.
    """
    with pytest.MonkeyPatch.context() as environment:
        environment.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF")
        environment.setenv("ROS_LOG_DIR", str(tmp_path_factory.mktemp("ros_log")))
        environment.setenv("FASTDDS_BUILTIN_TRANSPORTS", "UDPv4")
        environment.setenv("ROS_PYTHON_CHECK_FIELDS", "1")
        yield


@pytest.fixture(scope="module")
def peer(request):
    """Return a node of the test's own, to talk to the nodes under test; by DDS where the file is
    marked `live`.
    """
    if request.node.get_closest_marker("live"):
        from processes import LivePeer

        with LivePeer(request.getfixturevalue("ros_domain")) as node:
            yield node
    else:
        from nodes import Peer

        request.getfixturevalue("no_discovery")
        with Peer() as node:
            yield node


@pytest.fixture
def panda():
    """Return the robot of most monitors under test."""
    from nodes import PANDA, robot

    return robot(PANDA)


@pytest.fixture
def monitor(running, panda):
    """Return the monitor that the file keeps running, all joints fresh; afterwards it must give
    right numbers again.
    """
    running.serves(panda)
    running.forget()
    yield running
    running.serves(panda, 1)
