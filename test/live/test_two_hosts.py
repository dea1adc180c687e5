# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The robot on one host, the monitor on another, and a wire between them that is cut, loses, delays and reorders."""

import contextlib
import time

import pytest

from network import Host, Pair, Wire
from nodes import START
from processes import LivePeer, node_process

pytestmark = [pytest.mark.full, pytest.mark.live, pytest.mark.root]

LEASE = """<?xml version="1.0" encoding="UTF-8"?>
<profiles xmlns="http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles">
  <participant profile_name="short lease" is_default_profile="true">
    <rtps><builtin><discovery_config>
      <leaseDuration><sec>5</sec></leaseDuration>
      <leaseAnnouncement><sec>0</sec><nanosec>500000000</nanosec></leaseAnnouncement>
    </discovery_config></builtin></rtps>
  </participant>
</profiles>
"""
"""Discovery drops participants that are silent for 5 s instead of 20 s."""


@pytest.fixture(scope="module")
def hosts():
    """Return two hosts."""
    with contextlib.ExitStack() as stack:
        try:
            yield [stack.enter_context(Host(number)) for number in (1, 2)]
        except OSError as error:
            pytest.skip(f"no second host: {error} (it needs root, /dev/net/tun and iproute2)")


@pytest.fixture(scope="module")
def wire(hosts):
    """Return the wire between the hosts."""
    with Wire(*hosts) as wire:
        yield wire


@pytest.fixture(scope="module")
def pair(ros_domain, hosts, wire, tmp_path_factory):
    """Start a robot on the first host, and a monitor on the second, which has the description from the wire."""
    lease = tmp_path_factory.mktemp("dds") / "lease.xml"
    lease.write_text(LEASE)
    with pytest.MonkeyPatch.context() as environment:
        environment.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET")
        for name in ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE"):
            environment.setenv(name, str(lease))
        start = {
            name: lambda *arguments, host=host, **parameters: host.run(node_process, *arguments, **parameters)
            for name, host in zip(("robot", "monitor"), hosts, strict=True)
        }
        with hosts[1].run(LivePeer, ros_domain) as peer, Pair(peer, "/far", start) as pair:
            pair.start("robot", "monitor")
            pair.wait_for_recovery(since=0)
            yield pair


@pytest.fixture(autouse=True)
def mended(pair, wire):
    """Forget what was published, and leave a good wire."""
    pair.forget()
    yield
    wire.treat()


def test_states_come_over_the_wire(pair, wire):
    carried = wire.carried[0]
    pair.wait_for_recovery(since=time.time_ns())
    assert wire.carried[0] >= carried + 40


@pytest.mark.parametrize("jitter", [0.0, 0.05], ids=["loss", "loss and reordering"])
def test_bad_wire(pair, wire, jitter):
    """A fifth of all frames is lost; each state that arrives has one outcome, the others are counted as lost."""
    before, overtaken = pair.reports.next(), wire.overtaken[0]
    wire.treat(loss=0.2, jitter=jitter)
    pair.wait_for_states(since=time.time_ns())
    wire.treat()
    assert (wire.overtaken[0] > overtaken) == (jitter > 0.0)
    pair.wait_for_recovery(since=time.time_ns())
    report = pair.reports.next()
    assert report.count("lost in transport") > before.count("lost in transport")
    assert report.outcomes() == report.count("received")


@pytest.mark.parametrize("longer", [False, True], ids=["shorter than the lease", "longer than the lease"])
def test_cut_wire(pair, wire, longer):
    """A cut that outlasts the lease makes the hosts forget each other, and find each other anew."""
    pair.wait_for_states(since=time.time_ns(), count=1)
    wire.cut()
    cut, carried = time.time_ns(), wire.carried.copy()
    pair.wait_for_silence(since=cut)
    if longer:
        known = lambda: pair.peer.node.count_publishers(pair.states.subscription.topic_name)  # noqa: E731
        pair.peer.wait_until(lambda: not known(), "the end of the lease", START)
    assert wire.carried == carried and wire.lost[0]
    mended = time.time_ns()
    wire.treat()
    pair.wait_for_recovery(since=mended)
