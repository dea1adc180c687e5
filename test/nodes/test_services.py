# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The dynamics services: Pinocchio's numbers for good requests, for bad ones a message that names
the fault.
"""

import math

import numpy as np
import pytest
from diag_dynamics.srv import Diagonalize, ForwardDynamics, InverseDynamics
from geometry_msgs.msg import Vector3, Wrench
from std_msgs.msg import String

from nodes import (
    LATCHED,
    PANDA,
    UR5,
    Monitor,
    S,
    Truth,
    assert_close,
    description,
    nanoseconds,
    robot,
)

SERVICES = {
    "forward_dynamics": ForwardDynamics,
    "inverse_dynamics": InverseDynamics,
    "diagonalize": Diagonalize,
}
GRAVITY = (1.0, -2.0, 3.0)


@pytest.fixture(scope="module")
def monitor(peer):
    """Start a monitor of the Panda, to which no joint state is ever sent."""
    with Monitor(peer, "/services", robot_description=robot(PANDA).path) as monitor:
        yield monitor


@pytest.fixture
def panda():
    """Return the robot of the monitor."""
    return robot(PANDA)


def state_of(panda, sample=0, names=None, more=(), **fields):
    """Return a state with other names, with more of them, or with other fields."""
    state = panda.message(0, panda.samples[sample], names)
    for name in more:
        state.name.append(name)
        for values in (state.position, state.velocity, state.effort):
            values.append(0.0)
    for field, values in fields.items():
        setattr(state, field, values)
    return state


def ask(monitor, service, state, gravity=None, **fields):
    """Call a service; gravity overrides the model's."""
    request = SERVICES[service].Request(state=state, override_gravity=gravity is not None, **fields)
    if gravity is not None:
        request.gravity = Vector3(x=gravity[0], y=gravity[1], z=gravity[2])
    return monitor.call(SERVICES[service], service, request)


def answer(monitor, robot, service, state, gravity=None, **fields):
    """Call a service, which must succeed and, where it names them, have the dofs from base to
    tip.
    """
    response = ask(monitor, service, state, gravity, **fields)
    assert response.success, response.message
    assert response.message == ""
    if service != "diagonalize":
        assert tuple(response.dof_names) == robot.names
    return response


def check_acceleration(truth, response):
    """q̈ in the units of √M_kk, as all dofs weigh alike there, and ν̇ along it."""
    assert_close(
        response.acceleration * truth.unit, truth.state.acceleration * truth.unit, truth.tolerance
    )
    s = truth.state
    scale = sum(map(np.linalg.norm, (s.nu_dot, s.coriolis, s.gravity, s.epsilon)))
    assert_close(np.array(response.nu_dot), s.nu_dot, truth.tolerance, scale)


# --- good requests


@pytest.mark.parametrize(
    "gravity", [None, GRAVITY], ids=["gravity of the model", "gravity of the request"]
)
@pytest.mark.parametrize("sample", range(2))
def test_dynamics(monitor, panda, sample, gravity):
    """q̈ of aba and τ of rnea, of shuffled names with a fixed joint among them."""
    q, qd, tau, qdd = panda.samples[sample]
    truth = Truth(panda, q, qd, tau, gravity)
    state = state_of(panda, sample, more=["panda_joint8"])
    check_acceleration(truth, answer(monitor, panda, "forward_dynamics", state, gravity))

    state = panda.message(0, (q, qd, np.zeros(len(q)), qdd))
    qdd_as_named = qdd[[panda.names.index(name) for name in state.name]].tolist()
    effort = answer(
        monitor, panda, "inverse_dynamics", state, gravity, acceleration=qdd_as_named
    ).effort
    expected = truth.state.oracle.inverse_dynamics(q, qd, qdd)
    assert_close(effort / truth.unit, expected / truth.unit, truth.tolerance)


@pytest.mark.parametrize(
    "gravity", [None, GRAVITY], ids=["gravity of the model", "gravity of the request"]
)
def test_diagonalize(monitor, panda, gravity):
    """All that the node publishes, l included, for the state of the request and with its stamp."""
    stamp = 5 * S + 7
    response = answer(
        monitor, panda, "diagonalize", panda.message(stamp, panda.samples[1]), gravity
    )
    truth = Truth(panda, *panda.samples[1][:3], gravity)
    topics = ("state", "coriolis", "kinetic_energy", "joint_space_dynamics")
    truth.check({topic: getattr(response, topic) for topic in topics}, stamp)
    truth.check_header(response.factors, stamp)
    truth.check_mass_matrix_factors(response.factors, with_inverse=True)
    assert nanoseconds(response.state.oldest_stamp) == stamp


def wrench(numbers):
    """Return a Wrench of six numbers."""
    force, torque = (
        Vector3(x=x, y=y, z=z) for x, y, z in np.reshape(numbers, (2, 3)).astype(float).tolist()
    )
    return Wrench(force=force, torque=torque)


@pytest.mark.parametrize("in_world", [False, True], ids=["link", "world"])
def test_wrenches(monitor, panda, in_world):
    """Wrenches on links enter as Jᵀf, with Pinocchio's Jacobian; two on one link act together."""
    q, qd, tau, _ = panda.samples[0]
    truth = Truth(panda, q, qd, tau)
    pushes = {
        "panda_hand": [1.0, 2.0, 3.0, 0.4, 0.5, 0.6],
        "panda_link3": [-7.0, 8.0, 9.0, 1.0, -1.1, 1.2],
    }
    effort = truth.state.oracle.effort_of(q, pushes, "world" if in_world else "link")
    parts = [("panda_hand", 0.25), ("panda_link3", 1.0), ("panda_hand", 0.75)]
    fields = {
        "wrench_links": [link for link, _ in parts],
        "wrenches": [wrench([part * number for number in pushes[link]]) for link, part in parts],
        "wrenches_in_world": in_world,
    }
    state = panda.message(0, panda.samples[0])
    response = answer(monitor, panda, "forward_dynamics", state, **fields)
    check_acceleration(Truth(panda, q, qd, tau + effort), response)
    response = answer(monitor, panda, "diagonalize", state, **fields)
    assert_close(np.array(response.external), truth.state.l @ effort, truth.tolerance)


def test_friction_is_opt_in(monitor, panda):
    """include_friction adds the URDF's damping, and nothing else does."""
    q, qd, tau, _ = panda.samples[0]
    damping = [2 * 0.3 if "finger" in name else 0.003 for name in panda.names]  # of two fingers
    state = panda.message(0, panda.samples[0])
    assert not answer(monitor, panda, "diagonalize", state).state.friction_valid
    rubbed = answer(monitor, panda, "diagonalize", state, include_friction=True)
    assert rubbed.state.friction_valid and rubbed.coriolis.friction_valid
    response = answer(monitor, panda, "forward_dynamics", state, include_friction=True)
    check_acceleration(Truth(panda, q, qd, tau - damping * qd), response)


# --- bad requests


NAMES = robot(PANDA).names
BAD_STATES = {
    "no joint at all": ({"names": ()}, "panda_joint1"),
    "joint missing": ({"names": NAMES[:3] + NAMES[4:]}, "panda_joint4"),
    "joint unknown": ({"more": ["elbow"]}, "'elbow'; expected each joint"),
    "joint twice": ({"more": ["panda_joint2"]}, "'panda_joint2'; expected each joint"),
    "fixed joint twice": ({"more": ["panda_joint8", "panda_joint8"]}, "panda_joint8"),
    "position missing": ({"position": []}, "state.position is empty"),
    "position too short": ({"position": [0.0] * 7}, "state.position has 7 entries for 8"),
    "velocity too long": ({"velocity": [0.0] * 9}, "state.velocity"),
    "effort too short": ({"effort": [1.0]}, "state.effort"),
    "position NaN": ({"position": [math.nan] * 8}, "position of joint 'panda_joint1'"),
    "velocity infinite": ({"velocity": [math.inf] * 8}, "velocity of joint 'panda_joint1'"),
    "effort NaN": (
        {"names": NAMES, "effort": [0.0] * 7 + [math.nan]},
        "joint 'panda_finger_joint1'",
    ),
    "too large": ({"velocity": [1e200] * 8}, "are too large: a result overflows"),
}


def assert_refused(response, named):
    """Nothing was computed, and the message names the fault."""
    assert not response.success
    assert named in response.message
    assert "internal error" not in response.message
    for field in ("acceleration", "nu_dot", "effort", "dof_names"):
        assert len(getattr(response, field, ())) == 0
    if hasattr(response, "state"):
        assert len(response.state.nu) == 0


@pytest.fixture
def answers_afterwards(monitor, panda):
    """After a bad request the services answer as before it."""
    yield
    truth = Truth(panda, *panda.samples[0][:3])
    check_acceleration(
        truth, answer(monitor, panda, "forward_dynamics", panda.message(0, panda.samples[0]))
    )


@pytest.mark.usefixtures("answers_afterwards")
@pytest.mark.parametrize("case", BAD_STATES)
def test_bad_state(monitor, panda, case):
    """The joint or the field is named, by every service."""
    fields, named = BAD_STATES[case]
    for service in SERVICES:
        assert_refused(ask(monitor, service, state_of(panda, **fields)), named)


@pytest.mark.usefixtures("answers_afterwards")
@pytest.mark.parametrize("gravity", [(0.0, math.nan, 0.0), (math.inf, 0.0, 0.0), (0.0, 0.0, 1e305)])
def test_bad_gravity(monitor, panda, gravity):
    """A gravity that is not finite or exceeds the bound is rejected; without override_gravity it is
    ignored.
    """
    state = panda.message(0, panda.samples[0])
    for service, kind in SERVICES.items():
        assert_refused(ask(monitor, service, state, gravity), "gravity")
        request = kind.Request(
            state=state, gravity=Vector3(x=gravity[0], y=gravity[1], z=gravity[2])
        )
        assert monitor.call(kind, service, request).success


NAN_WRENCH = wrench([0, 0, math.nan, 0, 0, 0.0])


@pytest.mark.usefixtures("answers_afterwards")
@pytest.mark.parametrize(
    ("fields", "named"),
    [
        (
            {"wrenches": [Wrench()]},
            "wrenches has 1 entries; expected one for each of 0 wrench_links",
        ),
        ({"wrench_links": ["tool"], "wrenches": [Wrench()]}, "wrench_links is 'tool'; expected"),
        (
            {"wrench_links": ["panda_hand"], "wrenches": [NAN_WRENCH]},
            "wrenches on link 'panda_hand' is ",
        ),
    ],
)
def test_bad_wrenches(monitor, panda, fields, named):
    """The field or the link is named."""
    for service in SERVICES:
        assert_refused(ask(monitor, service, panda.message(0, panda.samples[0]), **fields), named)


@pytest.mark.usefixtures("answers_afterwards")
@pytest.mark.parametrize(
    ("acceleration", "named"),
    [([1.0, 2.0], "acceleration has 2"), ([math.nan] * 8, "acceleration of joint 'panda_joint1'")],
)
def test_bad_acceleration(monitor, panda, acceleration, named):
    """Accelerations are checked like states."""
    state = panda.message(0, panda.samples[0])
    assert_refused(ask(monitor, "inverse_dynamics", state, acceleration=acceleration), named)


# --- the robot


def test_before_and_after_the_model(peer):
    """Without a robot all services say so; with its description they answer, without any joint
    state.
    """
    ur5 = robot(UR5)
    with Monitor(peer, "/later") as monitor:
        for service in SERVICES:
            assert_refused(
                ask(monitor, service, ur5.message(0, ur5.samples[0])), "robot_description"
            )
        descriptions = peer.publisher(String, "/later/robot_description", LATCHED)
        descriptions.publish(description(ur5.urdf))
        peer.wait_until(
            lambda: ask(monitor, "inverse_dynamics", ur5.message(0, ur5.samples[0])).success,
            "the robot to be in force",
        )
        truth = Truth(ur5, *ur5.samples[1][:3])
        check_acceleration(
            truth, answer(monitor, ur5, "forward_dynamics", ur5.message(0, ur5.samples[1]))
        )
