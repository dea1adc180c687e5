# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Robots with closed loops in what surrounds the sweeps: followers, friction, limits, joint states,
simulation, control.
"""

import warnings

import numpy as np
import pytest
import yaml

import diag_dynamics as dd
from diag_dynamics.exceptions import LoopError
from diag_dynamics.inspection import inspect_robot
from diag_dynamics.joint_states.assembler import Accepted, Rejected, StateAssembler
from diag_dynamics.joint_states.robot_joints import Options, joints_of
from diag_dynamics.page.frames import FrameMaker, States
from diag_dynamics.page.layout import Layout, tree_of
from diag_dynamics.page.scene import scene_of
from diag_dynamics.parameters.files import parameters_of
from diag_dynamics.parameters.monitor import PARAMETERS
from diag_dynamics.parameters.robot_models import model_of, require_as_made
from linkages import (
    BASE,
    COUPLER,
    CRANK,
    FIVE_BAR,
    FOUR_BAR,
    ROCKER,
    five_bar,
    four_bar,
    four_bar_followers,
    placed_by_page,
)

RUBBING = '<dynamics damping="0.3" friction="0.2"/>'
ANGLES = np.linspace(-3.0, 3.0, 9)


@pytest.fixture(scope="module")
def bar():
    return dd.load_urdf(four_bar(), loops=[FOUR_BAR])


def rates_of(crank, h=1e-5):
    """Return G of coupler and rocker by differences of trigonometry."""
    return (four_bar_followers(crank + h) - four_bar_followers(crank - h)) / (2.0 * h)


def tip_of_rocker(crank):
    """Return the position of the rocker's end."""
    angle = four_bar_followers(crank)[1]
    return np.array([0.5 + ROCKER * np.cos(angle), 0.0, -ROCKER * np.sin(angle)])


# --- Positions and rates


@pytest.mark.parametrize("crank", ANGLES)
def test_followers_of_a_four_bar(bar, crank):
    """Positions and G of coupler and rocker follow from the law of cosines."""
    result = bar.followers_at([crank, 0.3], [1.7, -2.0])
    assert result.names == ("coupler", "rocker")
    np.testing.assert_allclose(result.position, four_bar_followers(crank), atol=1e-12)
    np.testing.assert_allclose(result.ratios, np.outer(rates_of(crank), [1.0, 0.0]), atol=1e-8)
    np.testing.assert_allclose(result.rate, 1.7 * rates_of(crank), atol=1e-8)


def test_followers_of_mimic_joints():
    """Mimic joints come first, by their multipliers and offsets."""
    urdf = five_bar().replace(
        '<link name="base"/>',
        '<link name="base"/><link name="f"><inertial><mass value="1"/>'
        '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" '
        'iyz="0"/></inertial></link><joint name="m" type="continuous"><parent link="base"/>'
        '<child link="f"/>'
        '<mimic joint="c" multiplier="2" offset="0.5"/></joint>',
    )
    model = dd.load_urdf(urdf, loops=[FIVE_BAR])
    result = model.followers_at(model.start + np.array([0.1, 0.0, 0.0]), [1.0, 2.0, 3.0])
    assert result.names == ("m", "p2", "r2")
    assert (result.position[0], result.rate[0]) == (pytest.approx(0.7), 2.0)
    assert len(result.singularity) == 1 and result.singularity[0] > 0.1


def test_random_positions(tmp_path):
    """Loops are closed there, whatever came before, also for the poses of an inspection; other
    joints are not moved.
    """
    model = dd.load_urdf(five_bar(), loops=[FIVE_BAR])
    rng = np.random.default_rng(1)
    Q = np.array([model.random(rng) for _ in range(60)])
    for q in Q[::7]:
        dd.DiagonalDynamics(model).evaluate(q, np.ones(3))
    dd.DiagonalDynamics(model).evaluate(Q, np.ones((60, 3)))
    assert np.ptp(Q, axis=0).min() > 3.0
    path = tmp_path / "loops.yaml"
    path.write_text(yaml.safe_dump({"loops": [FIVE_BAR]}))
    report = inspect_robot(five_bar(), loops=str(path))
    assert report.facts["degrees_of_freedom"] == 3 and report.checks["gravity"] != "skipped"


# --- Errors and warnings


def test_open_loop():
    """Every method names the loop and its joints where it cannot be closed; batches name the state,
    too.
    """
    model = dd.load_urdf(five_bar(), loops=[FIVE_BAR])
    dynamics = dd.DiagonalDynamics(model)
    apart = np.array([0.0, -1.5, 1.5])
    text = r"loop 'five' \(p1, p2, r1, r2\) of robot 'five_bar' cannot be closed at these positions"
    for call in (
        lambda: dynamics.evaluate(apart, np.zeros(3)),
        lambda: dynamics.mass_matrix(apart),
        lambda: dynamics.jacobian(apart, "b2"),
        lambda: dynamics.epsilon_from_tau(apart, np.ones(3)),
        lambda: model.followers_at(apart),
    ):
        with pytest.raises(LoopError, match=text):
            call()
    rows = np.tile(model.start, (7, 1))
    rows[4] = apart
    for call in (
        lambda: dynamics.evaluate(rows, 0.0 * rows),
        lambda: dynamics.mass_matrix(rows),
    ):
        with pytest.raises(LoopError, match=f"state 4: {text}"):
            call()
    with pytest.raises(dd.InputError, match="'p1' is nan"):
        dynamics.evaluate([0.0, np.nan, 0.0], np.zeros(3))
    np.testing.assert_allclose(
        dynamics.mass_matrix(model.start), dd.DiagonalDynamics(model).mass_matrix(model.start)
    )


def test_last_state_after_an_open_one():
    """A state that is not on the straight line from the start is found again after one in which the
    loop is open.
    """
    model = dd.load_urdf(five_bar(), loops=[FIVE_BAR])
    dynamics = dd.DiagonalDynamics(model)
    corner = np.array([0.0, 0.75, 2.75])
    goal = np.array([0.0, -0.604, 3.509])
    for q in (*np.linspace(model.start, corner, 60), *np.linspace(corner, goal, 60)):
        mass = dynamics.mass_matrix(q)
    for _ in range(2):
        with pytest.raises(LoopError):
            dynamics.mass_matrix([0.0, -1.5, 1.5])
        np.testing.assert_allclose(dynamics.mass_matrix(goal), mass, rtol=1e-9)
    with pytest.raises(LoopError):
        model.followers_at(goal)


def test_positions_beyond_a_gap():
    """A state that small steps cannot reach from the start is not reached by a large one."""
    model = dd.load_urdf(five_bar(), loops=[FIVE_BAR])
    with pytest.raises(LoopError):
        model.followers_at([0.0, 5.45348675, -0.32880405])


def test_rounded_axes():
    """Axes askew by five digits of a description close a loop."""
    turned = f"{0.5 * np.pi!r} 0 0"
    askew = (
        four_bar()
        .replace('"0 1 0"', '"0 0 -1"')
        .replace('<origin xyz="0 0 0"/>', '<origin xyz="0 0 0" rpy="1.5708 0 0"/>')
    )
    askew = askew.replace('<origin xyz="0.5 0 0"/>', f'<origin xyz="0.5 0 0" rpy="{turned}"/>')
    for kind in ("point", "revolute"):
        model = dd.load_urdf(askew, loops=[FOUR_BAR | {"type": kind, "axis": [0, 0, -1]}])
        result = model.followers_at(model.start, [1.0, 0.5])
        np.testing.assert_allclose(result.position, four_bar_followers(model.start[0]), atol=1e-5)
        free = FOUR_BAR | {"type": kind, "axis": [0, 0, -1], "independent": []}
        assert dd.load_urdf(askew, loops=[free]).nv == 2


def test_locked_joints_of_a_loop():
    """They are neither independent nor started elsewhere; the other joints of the loop move."""
    model = dd.load_urdf(five_bar(), loops=[FIVE_BAR]).with_locked_joints({"p1": -0.2})
    assert model.dof_names == ("c", "r1") and set(model.followers) == {"p2", "r2"}


def test_nearly_singular_loop():
    """One warning names the loop whose independent joint is nearly at its dead point, where crank
    and coupler are in line.
    """
    model = dd.load_urdf(four_bar(), loops=[FOUR_BAR | {"independent": ["rocker"]}])
    dead = -np.arccos(-(BASE**2 + ROCKER**2 - (CRANK + COUPLER) ** 2) / (2.0 * BASE * ROCKER))
    dynamics = dd.DiagonalDynamics(model)
    q = model.start
    k = model.dof_names.index("rocker")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for distance in (0.3, 1e-2, 1e-4, 1e-6, 1e-8, 1e-10):
            q[k] = dead - distance
            dynamics.evaluate(q, np.zeros(2))
    q[k] = dead - 1e-14
    with pytest.warns(
        dd.LoopWarning, match=r"loop 'bar' \(crank, coupler, rocker\) .* nearly singular"
    ) as result:
        dynamics.evaluate(q, np.zeros(2))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        dynamics.evaluate(q, np.zeros(2))
    assert len(result) == 1
    q[k] = dead + 1e-6
    with pytest.raises(LoopError, match="loop 'bar'"):
        dynamics.evaluate(q, np.zeros(2))


# --- Limits


@pytest.mark.parametrize("kind", ["revolute", "continuous"])
def test_limits_of_followers(kind):
    """An independent joint stops where its follower does; if that is beyond at the start, its
    limits are named as omitted.
    """
    omitted = ("limits of joint 'rocker', which follows crank",)
    limit = '<limit lower="-2.3" upper="-1.6" effort="1" velocity="1"/>'
    crank = '<limit lower="-3" upper="3" effort="9" velocity="9"/>'
    model = dd.load_urdf(four_bar(limit, crank, kind), loops=[FOUR_BAR])
    if kind == "continuous":
        assert (model.lower[0], model.upper[0]) == (-np.inf, np.inf) and model.omitted == omitted
        return
    for end, expected in ((model.lower[0], -1.6), (model.upper[0], -2.3)):
        assert abs(end) < 3.0
        assert four_bar_followers(end)[1] == pytest.approx(expected, abs=1e-6)
    beyond = dd.load_urdf(four_bar(limit.replace("-1.6", "-2.2"), crank, kind), loops=[FOUR_BAR])
    assert (beyond.lower[0], beyond.upper[0]) == (-3.0, 3.0) and beyond.omitted == omitted


def test_limits_by_the_loop():
    """A rocker that drives has the range in which the loop can be closed; limits of several joints'
    followers are omitted.
    """
    limit = '<limit lower="-6" upper="6" effort="1" velocity="1"/>'
    model = dd.load_urdf(four_bar(limit), loops=[FOUR_BAR | {"independent": ["rocker"]}])
    k = model.dof_names.index("rocker")
    angles = [four_bar_followers(crank)[1] for crank in np.linspace(-np.pi, np.pi, 4001)]
    assert model.lower[k] == pytest.approx(min(angles), abs=1e-5)
    assert model.upper[k] == pytest.approx(max(angles), abs=1e-5)
    urdf = five_bar('<limit lower="-1" upper="1" effort="1" velocity="1"/>').replace(
        '"p2" type="continuous"', '"p2" type="revolute"'
    )
    assert dd.load_urdf(urdf, loops=[FIVE_BAR]).omitted == (
        "limits of joint 'p2', which follows p1, r1",
    )


# --- Friction


def test_friction_of_followers():
    """Friction of followers acts at their own rates, so its power is that of the joints
    themselves.
    """
    model = dd.load_urdf(four_bar(RUBBING, RUBBING), loops=[FOUR_BAR])
    dynamics = dd.DiagonalDynamics(model)
    v0 = model.friction_velocity

    def friction(rate):
        return 0.3 * rate + 0.2 * np.tanh(rate / v0)

    Q = np.column_stack([ANGLES, np.zeros(9)])
    QD = np.column_stack([np.linspace(-2.0, 2.5, 9), np.ones(9)])
    expected = []
    for (crank, _), (rate, _) in zip(Q, QD, strict=True):
        G = rates_of(crank)[1]
        expected.append([friction(rate) + G * friction(G * rate), 0.0])
    result = [dynamics.friction_torque(qd, q) for q, qd in zip(Q, QD, strict=True)]
    np.testing.assert_allclose(result, expected, atol=1e-6)
    np.testing.assert_allclose(dynamics.friction_torque(QD, Q), expected, atol=1e-6)
    with pytest.raises(dd.InputError, match="q is missing"):
        dynamics.friction_torque(QD[0])
    s = dynamics.evaluate(Q[2], QD[2], friction=True)
    np.testing.assert_allclose(
        s.friction, dynamics.epsilon_from_tau(Q[2], np.array(expected[2])), atol=1e-6
    )
    batch = dynamics.evaluate(Q, QD, friction=True)
    np.testing.assert_allclose(batch.friction[2], s.friction, atol=1e-12)
    rejected = {"joints": {"rocker": {"load_friction": 0.1}}}
    with pytest.raises(dd.UnsupportedError, match="load_friction of joint 'rocker'"):
        dd.load_urdf(four_bar(), loops=[FOUR_BAR], parameters=rejected)


# --- Simulation


def test_simulated_friction():
    """The audit of a rubbing four-bar closes, and its rate is that of the equations at small
    steps.
    """
    model = dd.load_urdf(four_bar(RUBBING), loops=[FOUR_BAR])
    q = model.start
    qd = np.array([3.0, 0.5])
    simulation = dd.Simulation(model, q=q, qd=qd, step=1e-6)
    simulation.advance(steps=20)
    sliding = dd.load_urdf(four_bar(RUBBING), loops=[FOUR_BAR], friction_velocity=1e-6)
    expected = dd.DiagonalDynamics(sliding).forward_dynamics(q, qd, np.zeros(2), friction=True)
    np.testing.assert_allclose((simulation.qd - qd) / 2e-5, expected, rtol=3e-3)
    residuals = []
    for step in (2e-3, 1e-3, 5e-4):
        simulation = dd.Simulation(model, q=q, qd=qd, step=step)
        simulation.advance(steps=round(3.0 / step))
        residuals.append(abs(simulation.audit.residual))
        assert simulation.audit.loss < -0.2
    assert residuals[2] < 1e-4
    assert residuals[1] < residuals[0] / 2.0
    assert residuals[2] < residuals[0] / 8.0
    two = dd.load_urdf(five_bar(RUBBING), loops=[FIVE_BAR])
    with pytest.raises(dd.UnsupportedError, match="'p2' follows several joints and has friction"):
        dd.Simulation(two)


def test_simulated_stop():
    """A crank stops where its rocker reaches its limit, and rests there."""
    limit = '<limit lower="-2.3" upper="-1.6" effort="1" velocity="1"/>'
    model = dd.load_urdf(
        four_bar(limit, limit.replace("-2.3", "-3").replace("-1.6", "3"), "revolute"),
        loops=[FOUR_BAR],
    )
    simulation = dd.Simulation(model, q=model.start, effort_limits=False)
    simulation.advance([40.0, 0.0], steps=2000)
    assert "crank" in simulation.at_limit and simulation.qd[0] == 0.0
    assert model.followers_at(simulation.q).position[1] == pytest.approx(-2.3, abs=1e-6)


def test_simulated_opening():
    """A five-bar that is torn apart ends in an error that names the loop; its state is the last
    good one.
    """
    model = dd.load_urdf(five_bar(), loops=[FIVE_BAR])
    simulation = dd.Simulation(model, q=model.start)
    with pytest.raises(LoopError, match=r"loop 'five' \(p1, p2, r1, r2\)"):
        for _ in range(400):
            simulation.advance([0.0, -30.0, 30.0], steps=5)
    assert simulation.time > 0.05 and np.isfinite(simulation.qd).all()
    model.followers_at(simulation.q)


# --- Joint states


def send(
    assembler,
    crank,
    *,
    names=("crank", "arm", "coupler", "rocker"),
    off=0.0,
    effort=(),
    stamp=1,
    base=(),
):
    """Send a joint state of a four-bar whose rocker is `off` from where it should be."""
    coupler, rocker = four_bar_followers(crank)
    values = {"crank": (crank, 1.0), "arm": (0.2, -0.5)}
    values |= {"coupler": (coupler + 2 * np.pi, 0.0), "rocker": (rocker + off, 0.0)}
    fields = [values[name][0] for name in names], [values[name][1] for name in names], list(effort)
    return assembler.accept_values(tuple(names), stamp, 0, fields, stamp * 10**9)


def test_joint_states_with_followers(bar):
    """Messages may have followers: positions are compared, angles wrap, efforts are reflected by G
    of the state.
    """
    assembler = StateAssembler(joints_of(bar), Options(mimic_tolerance=0.01))
    for stamp, crank in enumerate((0.5, 0.9, 1.4), 1):
        accepted = send(assembler, crank, effort=(2.0, 0.3, -1.0, 4.0), stamp=stamp)
        assert isinstance(accepted, Accepted)
        np.testing.assert_array_equal(accepted.state.position, [crank, 0.2])
        expected = [2.0 + rates_of(crank) @ [-1.0, 4.0], 0.3]
        np.testing.assert_allclose(accepted.state.effort, expected, atol=1e-8)
    assert not assembler.counts["mimic disagreement"]
    accepted = send(assembler, 1.5, names=("crank", "arm"), effort=(2.0, 0.3), stamp=5)
    np.testing.assert_allclose(accepted.state.effort, [2.0, 0.3])  # those of followers are stale
    assert isinstance(send(assembler, 1.6, off=0.02, stamp=6), Accepted)
    assert assembler.counts["mimic disagreement"] == 1
    expected = four_bar_followers(1.6)[1]
    text = (
        f"position of joint 'rocker' is {expected + 0.02:.9g}; expected {expected:.9g} from 'crank'"
    )
    assert text in assembler.last_texts["mimic disagreement"]


def test_joint_states_of_an_open_loop():
    """A state in which a loop cannot be closed is rejected by its name, and the next one
    accepted.
    """
    model = dd.load_urdf(five_bar(), loops=[FIVE_BAR])
    assembler = StateAssembler(joints_of(model), Options())
    result = []
    for k, position in enumerate(((0.1, -0.3, 0.4), (0.1, -1.5, 1.5), (0.1, -0.31, 0.41)), 1):
        result.append(
            assembler.accept_values(("c", "p1", "r1"), k, 0, (position, np.zeros(3), ()), 0)
        )
    assert [type(entry) for entry in result] == [Accepted, Rejected, Accepted]
    assert result[1].cause == "open loop"
    assert result[1].text.startswith("loop 'five' (p1, p2, r1, r2) cannot be closed")


# --- Page, control, files


def test_page(bar):
    """The page's tree, at the numbers of a frame, puts both ends of the loop on one point; it
    begins with a closed one.
    """
    dynamics = dd.DiagonalDynamics(bar)
    layout = Layout(bar)
    q = np.array([[0.7, 0.3], [-1.9, 0.1]])
    qd = np.zeros((2, 2))
    s = dynamics.evaluate(q, qd)
    frames = FrameMaker(dynamics).frames(States.of(np.arange(2.0), q, qd, None, s))
    assert layout.to_json()["coordinates"] == ["crank", "arm", "coupler", "rocker"]
    rows = [*frames["numbers"][:, layout.places["q"]], np.array(scene_of(bar, four_bar())["rest"])]
    np.testing.assert_allclose(rows[2][:2], bar.start)
    for row in rows:
        places = placed_by_page(tree_of(bar), row, bar.link_names)
        np.testing.assert_allclose(
            places["coupler"] @ [COUPLER, 0, 0, 1], places["rocker"] @ [ROCKER, 0, 0, 1], atol=1e-6
        )
        np.testing.assert_allclose(
            dynamics.placement(row[:2], "rocker"), places["rocker"], atol=1e-6
        )
        point = places["rocker"] @ [ROCKER, 0, 0, 1]
        np.testing.assert_allclose(point[:3], tip_of_rocker(row[0]), atol=1e-6)


def test_files(tmp_path):
    """A file of loops is the value of loops_file: in a list of parameter files, and for the model
    of a node.
    """
    path = tmp_path / "loops.yaml"
    path.write_text(yaml.safe_dump({"loops": [FOUR_BAR]}))
    assert parameters_of([path]) == {"loops_file": str(path)}
    values = {name: spec.default for name, spec in PARAMETERS.items()} | {"loops_file": str(path)}
    model = model_of(four_bar(), values)
    assert dict(model.followers) == {"coupler": ("crank",), "rocker": ("crank",)}
    with pytest.raises(dd.InputError, match="parameter 'loops_file'"):
        require_as_made(values)
