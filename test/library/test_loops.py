# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Closed loops and non-linear mimic joints, against Pinocchio with constraints."""

import pickle
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import diag_dynamics as dd
from closed_loops import ClosedLoops
from diag_dynamics.model import loops as reader
from diag_dynamics.model.mimic import FollowerMotion
from diag_dynamics.yaml_files import read_yaml
from robots import description, joint, link

EXAMPLES = Path(__file__).parents[2] / "examples" / "closed_loops"
Y, ORIGIN = (0, 1, 0), (0, 0, 0)


def body(name, k):
    """Return a link that has an inertia of no symmetry."""
    com = (0.1 + 0.02 * k, 0.03 * (-1) ** k, 0.05)
    return link(
        name, mass=1.0 + 0.3 * k, com=com, inertia=(0.02, 0.002, -0.001, 0.03, 0.0015, 0.025)
    )


def hinge(name, parent, child, xyz, axis=Y):
    return joint(name, "continuous", parent, child, xyz=xyz, axis=axis)


NAMES = ("crank", "coupler", "rocker", "arm")
FOUR_BAR = description(
    "four",
    link("base"),
    *(body(name, k) for k, name in enumerate(NAMES)),
    hinge("j1", "base", "crank", ORIGIN),
    hinge("j2", "crank", "coupler", (0.2, 0, 0)),
    hinge("j3", "base", "rocker", (0.5, 0, 0)),
    hinge("j4", "coupler", "arm", (0.4, 0, 0.1), (1, 0, 0.3)),
)
BAR = {
    "name": "bar",
    "a": {"link": "coupler", "xyz": [0.5, 0, 0]},
    "b": {"link": "rocker", "xyz": [0.4, 0, 0]},
    "independent": ["j1"],
    "start": {"j1": 0.5, "j2": -0.8, "j3": -1.5},
}
BAR_PAIR = ("coupler", (0.5, 0, 0), "rocker", (0.4, 0, 0))
FIVE_BAR = description(
    "five",
    link("base"),
    *(body(name, k) for k, name in enumerate(("carrier", "a1", "a2", "b1", "b2", "tip"))),
    hinge("c", "base", "carrier", (0, 0, 0.3), (0, 0, 1)),
    hinge("p1", "carrier", "a1", (-0.2, 0, 0)),
    hinge("p2", "a1", "a2", (0, 0, 0.4)),
    hinge("r1", "carrier", "b1", (0.2, 0, 0)),
    hinge("r2", "b1", "b2", (0, 0, 0.4)),
    hinge("t", "a2", "tip", (0.3, 0, 0.3), (1, 0.3, 0)),
)
FIVE = {
    "name": "five",
    "a": {"link": "a2", "xyz": [0.35, 0, 0.35]},
    "b": {"link": "b2", "xyz": [-0.25, 0, 0.35]},
    "start": {"p1": -0.3, "r1": 0.4},
}
SPATIAL = description(
    "spatial",
    link("base"),
    *(body(name, k) for k, name in enumerate(("a1", "a2", "a3", "b1", "b2", "b3", "tip"))),
    hinge("a1", "base", "a1", ORIGIN, (0, 0, 1)),
    hinge("a2", "a1", "a2", (0.1, 0, 0.2), (0, 1, 0.2)),
    hinge("a3", "a2", "a3", (0.4, 0.05, 0), (0.1, 1, 0)),
    hinge("b1", "base", "b1", (0.6, 0, 0), (0, 0.1, 1)),
    hinge("b2", "b1", "b2", (0, 0.1, 0.2), (0.2, 1, 0)),
    joint("b3", "prismatic", "b2", "b3", xyz=(-0.2, 0, 0.1), axis=(1, 0, 0.1)),
    hinge("t", "a3", "tip", (0.2, 0.1, 0), (1, 0, 0)),
)
BALL = {
    "name": "ball",
    "a": {"link": "a3", "xyz": [0.3, 0, 0.05]},
    "b": {"link": "b3", "xyz": [0.05, 0.02, 0]},
}
REVOLUTE = BAR | {"type": "revolute", "axis": list(Y)}
WELD = BAR | {
    "type": "weld",
    "a": {"link": "coupler", "xyz": [0.5, 0, 0]},
    "b": {"link": "end", "xyz": [0.0, 0, 0]},
}
WELDED = FOUR_BAR.replace(
    "</robot>", body("end", 4) + hinge("j5", "rocker", "end", (0.4, 0, 0)) + "</robot>"
)
CORNERS = [((0.5 + x, y, 0), (x, y, 0)) for x, y in ((0, 0), (0.3, 0), (0, 0.3))]
SPLINE = CubicSpline([-1.0, 0.0, 0.7, 1.5], [0.3, 0.1, 0.6, 1.4])
PIECES = np.column_stack([SPLINE.x[:-1], SPLINE.c[::-1].T])
"""Pieces of the position of a joint by that of j1."""


def table(source):
    """Return the spline and its two derivatives."""
    return [float(SPLINE(source, k)) for k in range(3)]


def polynomial(coefficients):
    """Return the function that gives a polynomial and its two derivatives."""
    value = np.polynomial.Polynomial(coefficients)
    return lambda x: (value(x), value.deriv()(x), value.deriv(2)(x))


P = [0.2, 0.7, 0.3, -0.1]
Q = {"source": "j2", "polynomial": P}
CASES = {  # URDF, loops, pairs of points and curves of the oracle
    "four-bar": (FOUR_BAR, [BAR], [BAR_PAIR], {}),
    "revolute": (FOUR_BAR, [REVOLUTE], [BAR_PAIR], {}),
    "weld": (WELDED, [WELD], [("coupler", a, "end", b) for a, b in CORNERS], {}),
    "five-bar": (
        FIVE_BAR,
        [FIVE | {"independent": ["p1", "r1"]}],
        [("a2", (0.35, 0, 0.35), "b2", (-0.25, 0, 0.35))],
        {},
    ),
    "spatial": (SPATIAL, [BALL], [("a3", (0.3, 0, 0.05), "b3", (0.05, 0.02, 0))], {}),
    "polynomial": (
        FOUR_BAR,
        {"mimics": {"j3": {"source": "j1", "polynomial": P}}},
        [],
        {"j3": ("j1", polynomial(P))},
    ),
    "table": (
        FOUR_BAR,
        {"mimics": {"j2": dd.Curve("j1", PIECES)}},
        [],
        {"j2": ("j1", table)},
    ),
    "polynomial in a loop": (
        FOUR_BAR,
        {"loops": [BAR], "mimics": {"j4": Q}},
        [BAR_PAIR],
        {"j4": ("j2", polynomial(P))},
    ),
    "cam": (
        FOUR_BAR.replace(
            "</robot>", body("cam", 4) + hinge("j0", "base", "cam", (0, 0.1, 0)) + "</robot>"
        ),
        {"loops": [BAR | {"independent": ["j0"]}], "mimics": {"j1": Q | {"source": "j0"}}},
        [BAR_PAIR],
        {"j1": ("j0", polynomial(P))},
    ),
}


class Case:
    """A robot with loops in the library and in Pinocchio, with armature on every joint."""

    def __init__(self, urdf, loops, pairs, curves):
        self.urdf = urdf
        self.loops = loops
        self.pairs = pairs
        cut = dd.load_urdf(urdf, mimic="free", loops=[])
        self.armature = {name: 0.02 + 0.01 * k for k, name in enumerate(cut.dof_names)}
        self.model = dd.load_urdf(urdf, loops=loops, armature=self.armature)
        self.dynamics = dd.DiagonalDynamics(self.model)
        start = dict.fromkeys(cut.dof_names, 0.0) | closed(
            FollowerMotion(self.model), self.model.start
        )
        self.oracle = ClosedLoops(urdf, self.model.dof_names, pairs, start, self.armature, curves)

    def states(self, count, seed=0, spread=0.2):
        """Yield positions near the start, rates and efforts."""
        rng = np.random.default_rng(seed)
        for _ in range(count):
            q = self.model.start + rng.uniform(-spread, spread, self.model.nq)
            yield q, rng.normal(size=self.model.nv), rng.normal(size=self.model.nv)


def closed(motion, q):
    """Return positions of followers by joint; the last ones choose the branch."""
    result = motion.at(q)
    return dict(zip(result.names, result.position, strict=True))


def ratios(model, q):
    """Return G of all joints, (joints, nv), and all positions, both by joint."""
    result = model.followers_at(q)
    at = zip((*model.coordinate_names, *result.names), (*q, *result.position), strict=True)
    return dict(
        zip((*model.dof_names, *result.names), (*np.eye(model.nv), *result.ratios), strict=True)
    ), dict(at)


@cache
def case(name):
    """Return a case of CASES or a mechanism of the examples."""
    if name in CASES:
        return Case(*CASES[name])
    urdf = (EXAMPLES / f"{name}.urdf").read_text()
    beside = EXAMPLES / f"{name}.yaml"
    loops = str(beside) if beside.exists() else None
    model = dd.load_urdf(urdf, loops=loops)
    pairs = [
        (entry.a.link, p, entry.b.link, q)
        for loop_model in model.loops
        for entry in loop_model
        for p, q in entry.points[: 1 if entry.type != "weld" else 3]
    ]
    mimic = (
        {"right_crank_joint": ("left_crank_joint", polynomial([0.0, -1.0]))}
        if "gripper" in name
        else {}
    )
    return Case(urdf, loops, pairs, mimic)


MECHANISMS = ["four_bar_gripper", "delta", "leg", "excavator"]


def test_branches():
    """Start values choose the branch."""
    starts = {"j1": 0.5, "j2": -0.8, "j3": -1.5}, {"j1": 0.5, "j2": 1.0, "j3": 1.5}
    up, down = (dd.load_urdf(FOUR_BAR, loops=[BAR | {"start": start}]) for start in starts)
    assert up.start[0] == pytest.approx(down.start[0])
    assert (
        closed(FollowerMotion(up), up.start)["j3"]
        < -0.5
        < 0.5
        < closed(FollowerMotion(down), down.start)["j3"]
    )


@pytest.mark.parametrize("name", [*CASES, *MECHANISMS])
def test_dynamics(name):
    """ν, C, ε_g, c and q̈ are those of the constrained robot."""
    it = case(name)
    for q, qd, tau in it.states(2, spread=0.05 if name in MECHANISMS else 0.2):
        M, c, g, nu, coriolis, gravity = it.oracle.at(q, qd)
        s = it.dynamics.evaluate(q, qd, tau)
        scale = np.linalg.norm(nu) * max(1.0, np.linalg.norm(nu))
        assert np.abs(s.nu - nu).max() <= 1e-12 * np.linalg.norm(nu)
        assert np.abs(s.coriolis - coriolis).max() <= 1e-12 * max(np.linalg.norm(coriolis), scale)
        assert np.abs(s.gravity - gravity).max() <= 1e-12 * np.linalg.norm(gravity)
        assert abs(s.nu @ s.coriolis) <= 1e-13 * np.linalg.norm(s.nu) * max(
            np.linalg.norm(s.coriolis), scale
        )
        assert (
            np.abs(it.dynamics.coriolis_torque(q, qd) - c).max()
            <= 1e-12 * (np.abs(c) + np.abs(g)).max()
        )
        expected = np.linalg.solve(M, tau - c - g)
        assert (
            np.abs(it.dynamics.forward_dynamics(q, qd, tau) - expected).max()
            <= 1e-11 * np.abs(expected).max()
        )
        both = [it.oracle.at(q, qd + sign * tau)[1] for sign in (1.0, -1.0)]  # C_s is bilinear
        actual = 4.0 * it.dynamics.coriolis_matrix_times(q, qd, tau)
        assert np.abs(both[0] - both[1] - actual).max() <= 1e-11 * (np.abs(both) + np.abs(g)).max()
        wrench = {it.model.link_names[-1]: tau[[0] * 6], it.model.link_names[1]: qd[[0] * 6]}
        effort = it.oracle.effort_of(q, qd, wrench)
        actual = it.dynamics.inverse_dynamics(q, qd, 0.0 * qd, wrench, frame="world")
        assert np.abs(actual + effort - c - g).max() <= 1e-11 * np.abs([effort, c, g]).max()
        actual = it.dynamics.regressor(q, qd, expected)
        Y = it.oracle.regressor(q, qd, expected, it.model.link_names)
        assert np.abs(actual - Y).max() <= 1e-9 * np.abs(Y).max()
        energy = it.oracle.potential_energy(q)
        assert it.dynamics.potential_energy(q) == pytest.approx(energy, rel=1e-11, abs=1e-11)


def test_start_far_from_closed():
    """Undamped steps end 0.12 m apart."""
    model = dd.load_urdf(WELDED, loops=[WELD | {"start": {}}])
    coupler, end = (
        dd.DiagonalDynamics(model).placement(model.start, name) for name in ("coupler", "end")
    )
    np.testing.assert_allclose(coupler @ [0.5, 0, 0, 1], end[:, 3], atol=1e-12)
    np.testing.assert_allclose(coupler[:3, :3], end[:3, :3], atol=1e-12)


def test_start_values_count_in_all_loops():
    heel, toe = read_yaml(EXAMPLES / "leg.yaml", "leg")["loops"]
    urdf = EXAMPLES / "leg.urdf"
    both = heel | {"start": heel["start"] | toe["start"]}
    model = dd.load_urdf(urdf, loops=[toe | {"start": {}}, both])
    expected = dd.load_urdf(urdf, loops=[heel, toe])
    np.testing.assert_allclose(model.start, expected.start, atol=1e-12)
    other = toe | {"start": toe["start"] | {"knee": -1.2}}
    with pytest.raises(
        dd.LoopError, match=r"'knee' is 1\.2 in loop 'heel' and -1\.2 in loop 'toe'"
    ):
        dd.load_urdf(urdf, loops=[heel, other])


def test_motor_at_a_dead_point(monkeypatch):
    """Crank and coupler are in line, and turn the rocker neither way."""
    triangle = [(0.7, 0.5, 0.4), (0.4, 0.5, 0.7)]  # opposite: rocker; crank and coupler
    crank, rocker = (np.arccos((a**2 + b**2 - c**2) / (2 * a * b)) for a, b, c in triangle)
    start = {"j1": -crank, "j2": 0.0, "j3": rocker - np.pi}
    bar = BAR | {"independent": [], "start": start}
    assert dd.load_urdf(FOUR_BAR, loops=[bar]).followers  # without motors nothing to warn of
    for choices in (reader.MAX_CHOICES, 0):
        monkeypatch.setattr(reader, "MAX_CHOICES", choices)
        with pytest.warns(dd.LoopWarning, match=r"'bar': .* dead point of motor 'j3', .*: j[12]\."):
            model = dd.load_urdf(with_element(driven("j3")), loops=[bar])
        assert "j3" in model.followers


def parallelogram(angle):
    rods = (("coupler", "crank", (0.3, 0, 0)), ("rocker", "base", (0.5, 0, 0)))
    urdf = description(
        "parallelogram",
        link("base"),
        *(body(name, k) for k, name in enumerate(("crank", "coupler", "rocker"))),
        hinge("j1", "base", "crank", ORIGIN),
        *(hinge(f"j{k}", parent, child, at) for k, (child, parent, at) in enumerate(rods, 2)),
    )
    ends = {
        "a": {"link": "coupler", "xyz": [0.5, 0, 0]},
        "b": {"link": "rocker", "xyz": [0.3, 0, 0]},
    }
    start = {"j1": angle, "j2": -angle, "j3": angle}
    return dd.load_urdf(
        urdf, loops=[{"name": "bars", "independent": ["j1"], "start": start} | ends]
    )


def test_change_point():
    """A parallelogram stays one where it might become an antiparallelogram."""
    model = parallelogram(0.5)
    motion = FollowerMotion(model)
    for angle in np.arange(0.5, -0.6, -0.07):
        at = closed(motion, np.array([angle]))
        assert at["j2"] == pytest.approx(-angle, abs=1e-9) and at["j3"] == pytest.approx(
            angle, abs=1e-9
        )
    with pytest.raises(dd.LoopError, match=r"'bars': the start is singular"):
        parallelogram(0.0)


def test_far_positions():
    """Those of a loop with one independent joint do not depend on the last state."""
    model = case("four-bar").model
    far = model.start + np.array([3.0, 0.0])
    motion = FollowerMotion(model)
    expected = closed(FollowerMotion(model), far)
    for way in np.array([[1.5, 0.0], [5.0, 0.3]]):
        closed(motion, model.start + way)
        assert closed(motion, far) == pytest.approx(expected, abs=1e-12)


def test_choice_among_many_joints(monkeypatch):
    """Driven joints are independent, and loops can be closed, also where not all choices are
    compared.
    """
    monkeypatch.setattr(reader, "MAX_CHOICES", 0)
    for urdf, loop_model in (
        (SPATIAL, [BALL]),
        (FIVE_BAR, [FIVE]),
        (with_element(HINGE + driven("j3")), None),
    ):
        model = dd.load_urdf(urdf, loops=loop_model)
        assert min(model.followers_at(model.start).singularity) > 0.01
    assert model.followers == {"j1": ("j3",), "j2": ("j3",)}


# --- Files


BROKEN = {
    "unknown link": ({"a": "elbow"}, "'elbow'; expected"),
    "foreign joint": (
        {"independent": ["j4"]},
        "independent joint 'j4' is not in it; its joints are j1, j2, j3",
    ),
    "too many": (
        {"independent": ["j1", "j2"]},
        "2 independent joints are given, j1, j2; its degrees of freedom are 1.",
    ),
    "open": (
        {"b": {"link": "rocker", "xyz": [2.0, 0, 0]}},
        "'bar' cannot be closed from the start values, ",
    ),
    "one link": ({"b": {"link": "coupler"}, "start": {}}, "start values, 0.5 remains"),
    "axes": (
        {
            "b": {"link": "rocker", "xyz": [0.4, 0, 0], "rpy": [np.pi, 0, 0]},
            "type": "revolute",
            "axis": list(Y),
        },
        "start values, 2 remains",
    ),
    "rigid": ({"b": {"link": "base", "xyz": [0.6, 0, 0.1]}}, "leaves none of its joints free"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_loops_that_cannot_be_closed(name):
    change, text = BROKEN[name]
    with pytest.raises(dd.LoopError, match="'bar'") as caught:
        dd.load_urdf(FOUR_BAR, loops=[BAR | {"independent": []} | change])
    assert text in str(caught.value)


WRONG = {
    "type": ([BAR | {"type": "screw"}], "loops: loop 'bar': type"),
    "twice": ([BAR, BAR], "two loops have the name 'bar'"),
    "independent": ([BAR | {"independent": 3}], "independent is 3; expected a list of joints"),
    "key": ([BAR | {"c": 1}], "loop 'bar' has 'c'; expected one of name, a, b"),
    "end": ([{"name": "bar", "a": "crank"}], "loop 'bar' has no b"),
    "no list": ({"loops": "bar"}, "loops is 'bar'; expected a list"),
    "polynomial": (
        {"mimics": {"j2": {"source": "j1", "polynomial": [0.0, np.nan]}}},
        "expected coefficients",
    ),
    "no polynomial": ({"mimics": {"j2": {"source": "j1"}}}, "mimics of 'j2' has no polynomial"),
    "source": (
        {"mimics": {"j2": {"source": "j9", "polynomial": [1]}}},
        "'j9'; expected",
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_wrong_files(name):
    source, text = WRONG[name]
    with pytest.raises((dd.InputError, dd.LoopError)) as caught:
        dd.load_urdf(FOUR_BAR, loops=source)
    assert text in str(caught.value)


START = (
    '<start joint="j1" position="0.5"/><start joint="j2" position="-0.8"/>'
    '<start joint="j3" position="-1.5"/>'
)
LOOP_JOINT = f"""<loop_joint name="bar" type="revolute"><link1 link="coupler" xyz="0.5 0 0"/>
<link2 link="rocker" xyz="0.4 0 0"/><axis xyz="0 1 0"/>
<independent joint="j1"/>{START}</loop_joint>"""
CONSTRAINT = f'''<constraint name="bar" type="TYPE"><parent link="coupler"/>
<parent_origin xyz="0.5 0 0"/>
<parent_axis xyz="0 1 0"/><child link="rocker"/><child_origin xyz="0.4 0 0" rpy="0 0 0.3"/>
<child_axis xyz="{float(np.sin(0.3))!r} {float(np.cos(0.3))!r} 0"/>{START}</constraint>'''


def with_element(element):
    return FOUR_BAR.replace("</robot>", element + "</robot>")


def test_start_without_a_position():
    with pytest.raises(dd.UrdfError, match="<start> has no position"):
        dd.load_urdf(with_element(LOOP_JOINT.replace(' position="0.5"', "")))


HINGE = CONSTRAINT.replace("TYPE", "continuous")


@pytest.mark.parametrize("element", [LOOP_JOINT, HINGE, CONSTRAINT.replace("TYPE", "spherical")])
def test_elements(element, tmp_path):
    """A loop in the URDF is closed; a file may add what its element lacks, and an empty list opens
    it.
    """
    expected = dd.DiagonalDynamics(dd.load_urdf(FOUR_BAR, loops=[BAR]))
    q = np.array([0.6, 0.1])
    qd = np.array([1.0, 2.0])
    path = tmp_path / "loops.yaml"
    path.write_text("loops: [{name: bar, independent: j1}]")
    for loops in (str(path), [{"name": "bar", "independent": ["j1"]}]):
        model = dd.load_urdf(with_element(element), loops=loops)
        for loop_model in (model, pickle.loads(pickle.dumps(model))):
            result = dd.DiagonalDynamics(loop_model).evaluate(q, qd)
            assert np.abs(result.coriolis - expected.evaluate(q, qd).coriolis).max() <= 1e-12
    assert dd.load_urdf(with_element(element)).nv == 2
    assert dd.load_urdf(with_element(element), loops=[]).nv == 4


def driven(joint):
    return f'<transmission name="t"><joint name="{joint}"/><actuator name="m"/></transmission>'


def test_driven_joint_is_independent():
    control = (
        '<ros2_control><joint name="j1"/><joint name="j2"/>'
        '<joint name="j3"><command_interface name="effort"/></joint></ros2_control>'
    )
    for element in (driven("j3"), control):
        model = dd.load_urdf(with_element(HINGE + element))
        assert model.followers == {"j1": ("j3",), "j2": ("j3",)}
