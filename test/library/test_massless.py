# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Joints that move no inertia: who is named, what cures it, and that nobody else is."""

import numpy as np
import pytest

import diag_dynamics as dd
import robots
from accuracy import assert_close, tolerance
from oracles import Oracle
from robots import description, in_other_units, joint, link

pytestmark = pytest.mark.filterwarnings("ignore::diag_dynamics.InertiaWarning")

ROMEO = "romeo_description/urdf/romeo.urdf"
SINGULAR = [id for id, exclusion in robots.EXCLUDED.items() if exclusion.reason == robots.SINGULAR]
BOX = {"mass": 2.0, "com": (0.1, 0.2, 0.3), "inertia": (0.1, 0.0, 0.0, 0.2, 0.0, 0.3)}
ROD = {"mass": 1.0, "com": (0, 0, 1), "inertia": (0.1, 0, 0, 0.1, 0, 0)}  # no inertia about z
DOT = {"mass": 1.0, "com": (0, 0, 0.5), "inertia": (0, 0, 0, 0, 0, 0)}


def robot(*elements):
    """Return a description with a first joint that moves a box, and more beyond it."""
    return description("r", link("base"), link("box", **BOX), joint("first", "revolute", "base", "box"), *elements)


# --- who is named

# Of each: the elements, the joints that are massless, and what is said of their links.
NOTHING = "has no <inertial>"
LITTLE = "has little inertia about that axis"
CASES = {
    "no inertial": ([link("a"), joint("j", "revolute", "box", "a")], {"j": ("a", NOTHING)}),
    "no inertial, continuous": ([link("a"), joint("j", "continuous", "box", "a")], {"j": ("a", NOTHING)}),
    "no inertial, prismatic": ([link("a"), joint("j", "prismatic", "box", "a")], {"j": ("a", NOTHING)}),
    "rod turning about itself": ([link("a", **ROD), joint("j", "revolute", "box", "a")], {"j": ("a", LITTLE)}),
    "point on the axis": ([link("a", **DOT), joint("j", "revolute", "box", "a")], {"j": ("a", LITTLE)}),
    "frames behind a fixed joint": (
        [link("a"), link("b"), joint("j", "revolute", "box", "a"), joint("weld", "fixed", "a", "b")],
        {"j": ("a", NOTHING)},
    ),
    "two tips and the joint that carries them": (
        [
            *(link(name) for name in "abc"),
            joint("arm", "revolute", "box", "a"),
            joint("left", "revolute", "a", "b"),
            joint("right", "prismatic", "a", "c"),
        ],
        {"arm": ("a", NOTHING), "left": ("b", NOTHING), "right": ("c", NOTHING)},
    ),
    "the inner one of two joints about one axis": (
        [link("a"), link("b", **BOX), joint("inner", "revolute", "box", "a"), joint("outer", "revolute", "a", "b")],
        {"inner": ("a", NOTHING)},
    ),
    "a cart on a cart": (
        [link("a"), link("b", **BOX), joint("inner", "prismatic", "box", "a"), joint("outer", "prismatic", "a", "b")],
        {"inner": ("a", NOTHING)},
    ),
    "nearly nothing": (
        [
            link("a", mass=1e-15, inertia=(1e-18, 0, 0, 1e-18, 0, 1e-18)),
            link("b", **BOX),
            joint("inner", "revolute", "box", "a"),
            joint("outer", "revolute", "a", "b"),
        ],
        {"inner": ("a", LITTLE)},
    ),
    "planar without mass": (
        [link("a"), joint("j", "planar", "box", "a")],
        {"j/v_x": ("a", NOTHING), "j/v_y": ("a", NOTHING), "j/w_z": ("a", NOTHING)},
    ),
    "planar that cannot turn": ([link("a", **ROD), joint("j", "planar", "box", "a")], {"j/w_z": ("a", LITTLE)}),
    "floating rod": (
        [link("a", **ROD), joint("j", "floating", "box", "a")],
        {"j/w_z": ("a", LITTLE)},
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_every_massless_joint_is_named(case):
    """With its D, its link, and what would cure it; and with nothing that would not."""
    elements, expected = CASES[case]
    with pytest.raises(dd.MasslessLinkError) as caught:
        dd.load_urdf(robot(*elements))
    error, message = caught.value, str(caught.value)
    assert error.joints == tuple(sorted(expected))
    assert np.abs(error.articulated_inertia).max() < 1e-10
    assert f"has {len(expected)} joint(s) that move no inertia" in message
    for name, D in zip(error.joints, error.articulated_inertia, strict=True):
        child, why = expected[name]
        assert f"joint '{name}' (D = {D:.3g}): link '{child}' {why}" in message
    assert "Give the link mass and inertia in the URDF" in message
    single = [name for name in error.joints if "/" not in name]
    if single:
        for cure in (f"armature={{'{single[0]}': …}}", f"locked_joints={{'{single[0]}': 0.0}}", "massless='lock'"):
            assert cure in message
    else:
        assert "armature" not in message and "lock" not in message


@pytest.mark.parametrize("case", [case for case, (_, joints) in CASES.items() if not any("/" in j for j in joints)])
def test_cures(case):
    """What the message offers works: armature, locks, and all of them locked at once."""
    elements, expected = CASES[case]
    urdf = robot(*elements)
    geared = dd.load_urdf(urdf, armature=dict.fromkeys(expected, 1e-3))
    held = dd.load_urdf(urdf, locked_joints=dict.fromkeys(expected, 0.0))
    locked = dd.load_urdf(urdf, massless="lock")
    assert set(locked.locked_joints) == set(held.locked_joints) == set(expected)
    assert locked.bodies.tobytes() == held.bodies.tobytes()
    fixed = urdf
    for name in expected:
        for kind in ("revolute", "continuous", "prismatic"):
            fixed = fixed.replace(f'name="{name}" type="{kind}"', f'name="{name}" type="fixed"')
    for model, reference in ((geared, urdf), (locked, fixed)):
        armature = {} if reference == fixed else dict.fromkeys(expected, 1e-3)
        oracle = Oracle(reference, model.dof_names, armature=armature)
        for sample in robots.samples(case, oracle):
            t = oracle.at(sample.q, sample.qd, sample.tau)
            s = dd.DiagonalDynamics(model).evaluate(t.q, t.qd, t.tau)
            assert_close(s.nu, t.nu, tolerance(t))
            assert_close(s.epsilon, t.epsilon, tolerance(t))
            assert (s.articulated_inertia > 1e-5).all()


def test_payload_cures_and_without_it_the_joint_is_named_again():
    urdf = robot(link("a"), joint("j", "revolute", "box", "a"))
    model = dd.load_urdf(urdf, payloads={"a": (1.0, (0.1, 0.0, 0.0))})
    assert model.dof_names == ("first", "j")
    with pytest.raises(dd.MasslessLinkError, match="'j'"):
        model.without_payload("a")
    with pytest.raises(dd.MasslessLinkError, match="'j'"):
        model.with_payload("a", 1.0, (0.0, 0.0, 0.1))  # a point on the axis
    assert model.with_payload("a", 1e-3, (0.01, 0.0, 0.0)).nv == 2


def test_locked_at_zero_or_at_the_limit_next_to_it():
    def limited(lower, upper):
        tip = joint("j", "revolute", "box", "a").replace('lower="-10" upper="10"', f'lower="{lower}" upper="{upper}"')
        return dict(dd.load_urdf(robot(link("a"), tip), massless="lock").locked_joints)["j"]

    assert [limited(-1, 2), limited(0.5, 2), limited(-3, -1)] == [0.0, 0.5, -1.0]


@pytest.mark.parametrize("floating", [False, True], ids=["fixed", "floating"])
@pytest.mark.parametrize("id", SINGULAR)
def test_romeo(id, floating):
    """Every one of the massless joints of the wheel's robots is named, and locking them is locking just them."""
    source, names = robots.robot_path(id), robots.EXCLUDED[id].joints
    with pytest.raises(dd.MasslessLinkError) as caught:
        dd.load_urdf(source, mimic="free", floating_base=floating)
    assert set(caught.value.joints) == set(names)
    locked = dd.load_urdf(source, mimic="free", massless="lock", floating_base=floating)
    held = dd.load_urdf(source, mimic="free", locked_joints=dict.fromkeys(names, 0.0), floating_base=floating)
    assert dict(locked.locked_joints) == dict.fromkeys(names, 0.0)
    assert locked.bodies.tobytes() == held.bodies.tobytes()
    geared = dd.load_urdf(source, mimic="free", armature=dict.fromkeys(names, 1e-3), floating_base=floating)
    assert geared.nv == locked.nv + len(names)


def test_massless_base_cannot_float():
    """The base is named; no armature or lock is offered, as there is none for it."""
    for urdf in (robots.PENDULUM, robots.TwoLinkArm().urdf):
        for massless in ("error", "lock"):
            with pytest.raises(dd.MasslessLinkError, match="root_joint/") as caught:
                dd.load_urdf(urdf, floating_base=True, massless=massless)
            assert "armature" not in str(caught.value)


# --- singular at some configurations only

GIMBAL = robot(
    link("yoke"),
    link("ring"),
    link("rotor", **BOX),
    joint("roll", "continuous", "box", "yoke", axis=(1, 0, 0)),
    joint("pitch", "continuous", "yoke", "ring", axis=(0, 1, 0)),
    joint("yaw", "continuous", "ring", "rotor", axis=(0, 0, 1)),
)


@pytest.mark.parametrize("turn", [1, -1, 3])
def test_gimbal_lock(turn):
    """Rings without mass: M is regular, but for a pitch of 90°, where roll and yaw have one axis. It says so there."""
    dyn = dd.DiagonalDynamics(dd.load_urdf(GIMBAL))
    assert dyn.model.dof_names == ("first", "roll", "pitch", "yaw")
    qd = np.array([0.1, 0.2, 0.3, 0.4])
    locked = np.array([0.3, 0.4, turn * np.pi / 2, 0.5])
    for call in (
        lambda: dyn.evaluate(locked, qd, qd),
        lambda: dyn.factors(locked),
        lambda: dyn.forward_dynamics(locked, qd, qd),
        *(lambda sweep=sweep: sweep(locked, qd) for sweep in (dyn.nu_from_qd, dyn.qd_from_nu)),
        *(lambda sweep=sweep: sweep(locked, qd) for sweep in (dyn.epsilon_from_tau, dyn.tau_from_epsilon)),
    ):
        with pytest.raises(dd.SingularMassMatrixError, match=r"joint 'roll' moves no inertia there \(D = ") as caught:
            call()
        assert caught.value.joint == "roll"
        assert abs(caught.value.articulated_inertia) < 1e-12
    # what needs no factor is answered, and one hundredth of a degree beside it everything is
    oracle = Oracle(GIMBAL, dyn.model.dof_names)
    t = oracle.at(locked, qd, qd)
    assert_close(dyn.mass_matrix(locked), t.M, 1e-12)
    assert_close(dyn.inverse_dynamics(locked, qd, qd), oracle.inverse_dynamics(locked, qd, qd), 1e-12)
    beside = oracle.at(locked + np.array([0, 0, 2e-4, 0]), qd, qd)
    s = dyn.evaluate(beside.q, beside.qd, beside.tau)
    assert_close(s.nu, beside.nu, tolerance(beside))
    assert_close(s.epsilon, beside.epsilon, tolerance(beside))


def test_gimbal_is_cured_by_armature():
    dyn = dd.DiagonalDynamics(dd.load_urdf(GIMBAL, armature={"roll": 1e-4}))
    locked = np.array([0.3, 0.4, np.pi / 2, 0.5])
    assert dyn.factors(locked).D[1] == pytest.approx(1e-4, rel=1e-6)


# --- no false alarm


@pytest.mark.parametrize("floating", [False, True], ids=["fixed", "floating"])
@pytest.mark.parametrize("id", robots.regular_robots())
def test_no_false_alarm(id, floating):
    """Grams or micrograms, millimetres or kilometres: what counts is one inertia relative to another."""
    urdf = robots.robot(id).urdf
    nv = dd.load_urdf(urdf, mimic="free", floating_base=floating).nv
    for mass, length in ((1e-3, 1), (1e-6, 1), (1e-9, 1e-3), (1e6, 1e3)):
        assert dd.load_urdf(in_other_units(urdf, mass, length), mimic="free", floating_base=floating).nv == nv


@pytest.mark.parametrize("factor", [1e-3, 1e-6])
@pytest.mark.parametrize("id", [id for id in robots.regular_robots() if "hand" in id or "dual" in id])
def test_light_fingers_on_a_heavy_robot(id, factor):
    """The last link of every finger a thousand or a million times lighter, the rest of the robot as it was."""
    urdf = robots.tips_lighter(robots.robot(id).urdf, factor)
    model = dd.load_urdf(urdf, mimic="free")
    oracle = Oracle(urdf, model.dof_names)
    for q, qd, tau, _ in robots.samples(id, oracle)[:1]:
        t, s = oracle.at(q, qd, tau), dd.DiagonalDynamics(model).evaluate(q, qd, tau)
        assert_close(s.nu, t.nu, tolerance(t))
        assert_close(s.epsilon, t.epsilon, tolerance(t))


@pytest.mark.parametrize("ratio", [1e-4, 1e-6, 1e-8])
def test_light_link_before_a_heavy_one(ratio):
    """A light ring between two heavy bodies that turn about one axis: D is what is left of the heavy one's inertia."""
    inertia = (ratio, 0, 0, ratio, 0, ratio)
    urdf = robot(
        link("ring", mass=ratio, inertia=inertia),
        link("rotor", mass=1.0, inertia=(1, 0, 0, 1, 0, 1)),
        joint("inner", "revolute", "box", "ring"),
        joint("outer", "revolute", "ring", "rotor"),
    )
    D = dd.DiagonalDynamics(dd.load_urdf(urdf)).factors(np.array([0.1, 0.2, 0.3])).D
    assert D[1] == pytest.approx(ratio, rel=1e-15 / ratio + 1e-12)


def concurrent_wrist(joints):
    """Return an arm whose axes meet in the centre of mass of its only heavy link."""
    parts = [link("l0")]
    for k in range(joints):
        parts.append(joint(f"j{k + 1}", "revolute", f"l{k}", f"l{k + 1}", axis=((0, 0, 1), (0, 1, 0))[k % 2]))
        heavy = (2.0, (0, 0, 0), (0.01, 0, 0, 0.012, 0, 0.009)) if k == joints - 1 else ()
        parts.append(link(f"l{k + 1}", *heavy))
    return description("wrist", *parts)


@pytest.mark.parametrize("joints", [5, 6, 7])
def test_rounding_that_joints_outboard_leave_is_no_inertia(joints):
    """Three axes take up all inertia of the tip; what is left for those inboard is noise, be there a rotor between or not."""
    urdf = concurrent_wrist(joints)
    with pytest.raises(dd.MasslessLinkError) as caught:
        dd.load_urdf(urdf, armature={"j2": 0.1})
    assert "j1" in caught.value.joints
    assert "j2" not in caught.value.joints
    held = dd.load_urdf(urdf, armature={"j2": 0.1}, massless="lock")
    dyn = dd.DiagonalDynamics(held)
    rng = np.random.default_rng(0)
    for _ in range(5):
        q, qd, tau = rng.uniform(-1.0, 1.0, (3, held.nv))
        M = dyn.mass_matrix(q)
        assert np.linalg.cond(M) < 1e6
        assert_close(M @ dyn.forward_dynamics(q, qd, tau), tau - dyn.bias(q, qd) - dyn.gravity_torque(q), 1e-10)
