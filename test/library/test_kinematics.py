# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Jacobians, motions of links and configurations: against Pinocchio, and by the properties that
define them.
"""

import math

import numpy as np
import pinocchio as pin
import pytest

import diag_dynamics as dd
from accuracy import EPS
from oracles import Oracle
from robots import description, joint, link, random_robots, random_tree, robot

ROBOTS = [
    robot("panda_description/urdf/panda.urdf"),
    robot("ur_description/urdf/ur5_robot.urdf"),
    robot("talos_data/robots/talos_reduced.urdf").floating,
    *random_robots()[2:6],
]
pytestmark = pytest.mark.filterwarnings("ignore::diag_dynamics.InertiaWarning")
FRAMES = {"link": pin.LOCAL, "world": pin.LOCAL_WORLD_ALIGNED}


def loaded(one):
    model = dd.load_urdf(one.urdf, mimic="free", **one.options)
    return model, Oracle(one.urdf, model.dof_names, floating_base=model.floating_base)


def close(found, expected, scale=1.0):
    size = max(np.abs(expected).max(initial=0.0), scale)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e4 * EPS * size)


def some_links(model, rng):
    return [
        model.root_link,
        *rng.choice(model.link_names, min(6, len(model.link_names)), replace=False),
    ]


@pytest.mark.parametrize("one", ROBOTS)
def test_jacobian_and_motion_of_links(one):
    """Columns, velocities and both accelerations are Pinocchio's, in both frames."""
    model, oracle = loaded(one)
    dyn = dd.DiagonalDynamics(model)
    rng = np.random.default_rng(4)
    for _ in range(2):
        q = model.random(rng)
        qd, qdd = rng.normal(size=(2, model.nv))
        pq = oracle.configuration(q)
        pv = oracle.to_pin(qd)
        pa = oracle.to_pin(qdd)
        pin.forwardKinematics(oracle.model, oracle.data, pq, pv, pa)
        pin.computeJointJacobians(oracle.model, oracle.data, pq)
        pin.updateFramePlacements(oracle.model, oracle.data)
        for name in some_links(model, rng):
            frame_id = oracle.model.getFrameId(name, pin.FrameType.BODY)
            for frame, reference in FRAMES.items():
                arguments = oracle.model, oracle.data, frame_id, reference
                J = dyn.jacobian(q, name, frame=frame)
                assert J.shape == (6, model.nv)
                close(
                    J, np.stack([oracle.from_pin(row) for row in pin.getFrameJacobian(*arguments)])
                )
                close(
                    dyn.link_velocity(q, name, qd, frame=frame),
                    pin.getFrameVelocity(*arguments).vector,
                    10.0,
                )
                classical = pin.getFrameClassicalAcceleration(*arguments).vector
                close(dyn.link_acceleration(q, name, qd, qdd, frame=frame), classical, 100.0)
                spatial = pin.getFrameAcceleration(*arguments).vector
                close(
                    dyn.link_acceleration(q, name, qd, qdd, frame=frame, spatial=True),
                    spatial,
                    100.0,
                )


@pytest.mark.parametrize("one", ROBOTS)
def test_integrate_and_difference(one):
    """Both are Pinocchio's, each undoes the other, and a configuration is nothing from itself."""
    model, oracle = loaded(one)
    rng = np.random.default_rng(8)
    for size in (1.0, 1e-3, 1e-9):
        q0 = model.random(rng)
        v = size * rng.normal(size=model.nv)
        q1 = model.integrate(q0, v)
        there = pin.integrate(oracle.model, oracle.configuration(q0), oracle.to_pin(v))
        assert pin.isSameConfiguration(oracle.model, oracle.configuration(q1), there, 1e-12)
        np.testing.assert_allclose(model.difference(q0, q1), v, rtol=0, atol=1e-13 + 1e-10 * size)
    q0 = model.random(rng)
    q1 = model.random(rng)
    apart = pin.difference(oracle.model, oracle.configuration(q0), oracle.configuration(q1))
    np.testing.assert_allclose(model.difference(q0, q1), oracle.from_pin(apart), rtol=0, atol=1e-9)
    assert not model.difference(q0, q0).any()


def test_difference_takes_the_shorter_way():
    """Of angles that turn round within half a turn; of a revolute joint with limits, the way there
    is.
    """
    model = dd.load_urdf(random_tree(3, 6, ("continuous", "planar")))
    q = model.neutral
    around = q.copy()
    for k, name in enumerate(model.coordinate_names):
        around[k] += (
            2 * math.pi if name in model.continuous_joints or name.endswith("/theta") else 0.0
        )
    np.testing.assert_allclose(model.difference(q, around), 0.0, atol=1e-14)


@pytest.mark.parametrize("one", ROBOTS)
def test_random_positions(one):
    """They are configurations within the limits, the same for the same seed, others for others."""
    model, _ = loaded(one)
    q = model.random(3)
    assert (q >= model.lower).all() and (q <= model.upper).all() and np.isfinite(q).all()
    assert (model.random(3) == q).all() and (model.random(4) != q).any()
    assert (model.random(np.random.default_rng(3)) == q).all()
    model.integrate(q, np.zeros(model.nv))  # raises if it is no orientation
    with pytest.raises(dd.InputError, match="rng"):
        model.random("seed")


def test_random_positions_with_few_limits():
    """Angles are within a turn, or within a turn of their only limit; positions within a metre."""
    body = {"mass": 1.0, "inertia": (1, 0, 0, 1, 0, 1)}
    joints = [joint("wheel", "continuous", "base", "a"), joint("slide", "planar", "a", "b")]
    for side, parent in (("lower", "b"), ("upper", "lower")):
        element = joint(side, "revolute", parent, side)
        joints.append(element.replace('lower="-10" upper="10"', f'{side}="2"'))
    links = [link(name, **body) for name in ("a", "b", "lower", "upper")]
    model = dd.load_urdf(description("free", link("base"), *links, *joints))
    q = np.array([model.random(seed) for seed in range(100)])
    at = dict(
        zip(model.coordinate_names, zip(q.min(axis=0), q.max(axis=0), strict=True), strict=True)
    )
    turn = 2.0 * math.pi
    for name, low, high, gap in (
        ("wheel", -math.pi, math.pi, 1.0),
        ("slide/theta", -math.pi, math.pi, 1.0),
        ("slide/x", -1.0, 1.0, 0.2),
        ("slide/y", -1.0, 1.0, 0.2),
        ("lower", 2.0, 2.0 + turn, 1.0),
        ("upper", 2.0 - turn, 2.0, 1.0),
    ):
        least, most = at[name]
        assert low <= least < low + gap and high - gap < most <= high, name


def test_wrong_arguments_are_named():
    model = dd.load_urdf(robot("panda_description/urdf/panda.urdf").urdf)
    dyn = dd.DiagonalDynamics(model)
    q = model.neutral
    zero = np.zeros(model.nv)
    free = dd.load_urdf(robot("panda_description/urdf/panda.urdf").urdf, floating_base=True)
    for text, call in (
        ("'hand'; expected", lambda: dyn.jacobian(q, "hand")),
        ("frame is 'body'", lambda: dyn.jacobian(q, "panda_hand", frame="body")),
        ("point", lambda: dyn.link_velocity(q, "panda_hand", zero, (1, 2))),
        (
            "v of joint 'panda_joint2' is nan",
            lambda: model.integrate(q, [0, math.nan, 0, 0, 0, 0, 0, 0]),
        ),
        ("q has shape", lambda: dyn.placement(np.stack([q, q]), "panda_hand")),
        ("q1 of joint 'root_joint'", lambda: free.difference(free.neutral, np.zeros(free.nq))),
    ):
        with pytest.raises(dd.InputError, match=text):
            call()


def test_a_screw_is_no_angle_that_turns_round():
    """A continuous joint that another one follows is elsewhere after a turn: its difference is the
    whole way.
    """
    urdf = description(
        "screw",
        link("base"),
        link("spindle", 1.0, inertia=(1, 0, 0, 1, 0, 1)),
        link("nut", 1.0, inertia=(1, 0, 0, 1, 0, 1)),
        joint("turn", "continuous", "base", "spindle"),
        joint("rise", "prismatic", "base", "nut").replace(
            "</joint>", '<mimic joint="turn" multiplier="0.01"/></joint>'
        ),
    )
    model = dd.load_urdf(urdf)
    assert model.difference([0.0], [20 * math.pi]) == pytest.approx(20 * math.pi)
    turned = dd.load_urdf(
        urdf.replace('joint="turn" multiplier="0.01"', 'joint="turn"').replace(
            '"prismatic"', '"revolute"'
        )
    )
    assert np.abs(turned.random(1)).max() <= math.pi


@pytest.mark.parametrize("squared", [1.0 - 9e-4, 1.0 + 9e-4, 1.0 - 1.1e-3, 1.0 + 1.1e-3])
def test_quaternions_near_unit_length_are_normalized(squared):
    dyn = dd.DiagonalDynamics(dd.load_robot("go2", floating_base=True))
    rng = np.random.default_rng(5)
    q = dyn.model.random(rng)
    qd = rng.normal(size=dyn.model.nv)
    scaled = q.copy()
    scaled[3:7] *= np.sqrt(squared)
    if abs(squared - 1.0) < 1e-3:
        np.testing.assert_allclose(
            dyn.nu_from_qd(scaled, qd), dyn.nu_from_qd(q, qd), rtol=1e-11, atol=1e-12
        )
    else:
        with pytest.raises(dd.InputError):
            dyn.nu_from_qd(scaled, qd)
