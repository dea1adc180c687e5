# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Contact: mobilities, transferable energy and impacts against Pinocchio and MuJoCo, by their
definitions.
"""

import math
import pickle
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import diag_dynamics as dd
import robots
from accuracy import EPS, norm
from coupling import NAMED, oracle_of
from derivative_oracles import jacobian
from described import PANDA, TALOS, UR5
from oracles import Oracle
from robots import description, joint, link, random_robots, robot

pytestmark = pytest.mark.filterwarnings("ignore::diag_dynamics.InertiaWarning")

ROOT = Path(__file__).parents[2]


def close(found, expected, tolerance, scale=None):
    """Whether numbers agree relative to a scale, by default the largest of the expected ones."""
    scale = np.abs(expected).max(initial=0.0) if scale is None else scale
    assert np.abs(np.asarray(found) - expected).max(initial=0.0) <= tolerance * scale


# --- Mobilities
# --------------------------------------------------------------------------------------------


COUPLED = [
    NAMED[name]._replace(mimic="embed") for name in ("parallel gripper", "nested three deep")
]


@pytest.mark.parametrize("one", [*robots.robots_to_test(), *COUPLED])
def test_mobilities_of_all_links(one):
    """J M⁻¹Jᵀ of every link, to 100 eps cond(M) of that link's; exactly symmetric."""
    model = dd.load_urdf(one.urdf, mimic=one.mimic, **one.options)
    oracle = oracle_of(one, model.dof_names)
    q = robots.samples(one.id, oracle)[0].q
    result = dd.DiagonalDynamics(model).mobilities(q)
    assert result.shape == (len(model.link_names), 6, 6)
    np.testing.assert_array_equal(result, result.transpose(0, 2, 1))
    M = oracle.mass_matrix(q)
    tolerance = 100 * EPS * np.linalg.cond(M)
    for k, name in enumerate(model.link_names):
        J = jacobian(oracle, q, name)
        close(result[k], J @ np.linalg.solve(M, J.T), tolerance)


def test_mobilities_refuse_what_is_wrong():
    dyn = dd.DiagonalDynamics(dd.load_urdf(robot(UR5).urdf))
    with pytest.raises(dd.InputError, match="shape"):
        dyn.mobilities(np.zeros(3))
    with pytest.raises(dd.InputError, match="elbow_joint"):
        dyn.mobilities([0, 0, math.nan, 0, 0, 0])


# --- Contact at points
# -------------------------------------------------------------------------------------


@pytest.mark.parametrize("one", [robot(PANDA), robot(TALOS).floating, *random_robots()[5:8]])
@pytest.mark.parametrize("worst_by", ["energy", "force", "limit"])
def test_worst_point_of_every_link(one, worst_by):
    """Of many points of a link the worst is found, and all that is said of it is what its
    definition gives.
    """
    model = dd.load_urdf(one.urdf, **one.options)
    dyn = dd.DiagonalDynamics(model)
    rng = np.random.default_rng(5)
    links = [name for name in model.link_names if model.placement_in_body(name)[0]]
    links = list(rng.choice(links, min(8, len(links)), replace=False))
    region = dd.BodyRegion(mass=3.0, stiffness=2e4, force=90.0, energy=0.7)
    limits = dd.ContactLimits({"hard": region, "clamped": {"stiffness": 1e4, "force": 120.0}})
    places = [dd.ContactPoint(name, name, rng.uniform(-0.2, 0.2, (5, 3))) for name in links]
    points = dd.ContactPoints(model, places, limits, worst_by)
    q = model.random(rng)
    qd = rng.normal(size=model.nv)
    c = dyn.contact_limits(q, qd, points)
    close(c.nu, dyn.nu_from_qd(q, qd), 1e-12)
    root = dyn.placement(q, model.root_link)
    for k, name in enumerate(links):
        scores = []
        for r in places[k].points:
            v = dyn.link_velocity(q, name, qd, r)[:3]
            m = dyn.reflected_mass(q, name, v, r)
            speed = norm(v)
            energy = 0.5 * m * v @ v
            impedances = np.sqrt([2e4 / (1.0 / m + 1.0 / 3.0), m * 1e4])
            forces = speed * impedances
            of_energy = math.sqrt(2.0 * 0.7 / m)
            speeds = of_energy, *([90.0, 120.0] / impedances)
            usage = speed / min(speeds)
            scores.append(
                (
                    {"energy": energy, "force": max(forces), "limit": usage}[worst_by],
                    r,
                    v,
                    m,
                    forces,
                    speeds,
                )
            )
        # Several may be equal: all points of a link on one joint are.
        score, r, v, m, forces, speeds = scores[c.point[k]]
        assert score == pytest.approx(max(scores, key=lambda entry: entry[0])[0], rel=1e-8)
        placement = np.linalg.inv(root) @ dyn.placement(q, name)
        close(c.position[k], placement[:3, :3] @ r + placement[:3, 3], 1e-12, 1.0)
        close(c.direction[k], placement[:3, :3] @ v / norm(v), 1e-9, 1.0)
        assert c.speed[k] == pytest.approx(norm(v), rel=1e-9)
        assert c.reflected_mass[k] == pytest.approx(m, rel=1e-8)
        assert c.energy[k] == pytest.approx(0.5 * m * v @ v, rel=1e-8)
        assert c.force[k] == pytest.approx(max(forces), rel=1e-8)
        assert c.allowed_speed[k] == pytest.approx(min(speeds), rel=1e-8)
        assert c.margin[k] == pytest.approx(min(speeds) - norm(v), rel=1e-7, abs=1e-9)
        assert c.region(k) == ("clamped" if np.argmin(speeds) == 2 else "hard")
    assert c.worst == np.argmin(c.margin)


def test_a_robot_at_rest_has_no_worst_point():
    """Nothing moves, so there is no direction along the motion, no mass, and nothing is exceeded;
    no number is NaN.
    """
    model = dd.load_urdf(robot(PANDA).urdf)
    points = dd.ContactPoints(
        model, [("tip", "panda_hand")], dd.ContactLimits({"any": {"energy": 1.0}})
    )
    c = dd.DiagonalDynamics(model).contact_limits(model.neutral, np.zeros(model.nv), points)
    assert c.worst == -1 and c.speed[0] == c.reflected_mass[0] == c.energy[0] == 0.0
    assert not c.direction.any() and c.region(0) == ""
    assert not any(
        np.isnan(getattr(c, name)).any()
        for name in ("usage", "margin", "allowed_speed", "position")
    )


def test_batch_has_the_bits_of_single_states():
    model = dd.load_urdf(robot(TALOS).urdf)
    dyn = dd.DiagonalDynamics(model)
    rng = np.random.default_rng(3)
    points = dd.ContactPoints(model, dd.link_geometry(model, robot(TALOS).urdf, "frames").points)
    Q = np.array([model.random(rng) for _ in range(300)])
    QD = rng.normal(size=(300, model.nv))
    many = dyn.contact_limits(Q, QD, points, threads=2)
    for t in (0, 7, 299):
        single = dyn.contact_limits(Q[t], QD[t], points)
        for name in (
            "nu",
            "position",
            "direction",
            "speed",
            "reflected_mass",
            "energy",
            "force",
            "point",
        ):
            np.testing.assert_array_equal(getattr(single, name), getattr(many, name)[t])
        assert many.worst[t] == single.worst
    QD[5, 2] = math.nan
    with pytest.raises(dd.InputError, match="state 5: qd of joint"):
        dyn.contact_limits(Q, QD, points)


def test_points_outlive_pickling():
    model = dd.load_urdf(robot(PANDA).urdf)
    points = dd.ContactPoints(
        model, [("tip", "panda_hand", (0, 0, 0.1))], dd.ContactLimits({"any": {"energy": 1.0}})
    )
    again = pickle.loads(pickle.dumps(points))
    q = model.random(1)
    qd = np.ones(model.nv)
    dyn = dd.DiagonalDynamics(model)
    np.testing.assert_array_equal(
        dyn.contact_limits(q, qd, points).position, dyn.contact_limits(q, qd, again).position
    )


@pytest.mark.parametrize(
    ("points", "said"),
    [
        ([("a", "nowhere")], "'nowhere'"),
        ([("a", "panda_hand", (0, 0))], "points of 'a'"),
        ([("a", "panda_hand", (0, 0, math.inf))], "points of 'a'"),
        ([("a", "panda_hand", (0, 0, 0), ["chest"])], "point 'a' is 'chest'"),
        ([("a", "panda_hand"), ("a", "panda_link4")], "'a' twice"),
    ],
)
def test_wrong_points_are_named(points, said):
    with pytest.raises(dd.InputError, match=said):
        dd.ContactPoints(dd.load_urdf(robot(PANDA).urdf), points)


def test_points_of_another_robot_are_refused():
    points = dd.ContactPoints(dd.load_urdf(robot(UR5).urdf), [("a", "wrist_3_link")])
    dyn = dd.DiagonalDynamics(dd.load_urdf(robot(PANDA).urdf))
    with pytest.raises(dd.InputError, match="of robot 'ur5'"):
        dyn.contact_limits(np.zeros(8), np.zeros(8), points)


# --- Impacts
# -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("one", [robot(PANDA), robot(TALOS).floating, robot(UR5)])
@pytest.mark.parametrize("restitution", [0.0, 0.6])
def test_impact_with_what_is_clamped(one, restitution):
    """q̇⁺ is that of pin.impulseDynamics, to 100 eps cond(M)."""
    model = dd.load_urdf(one.urdf, mimic="free", **one.options)
    oracle = Oracle(one.urdf, model.dof_names, **one.options)
    dyn = dd.DiagonalDynamics(model)
    name = model.link_names[-1]
    r = np.array([0.05, -0.02, 0.1])
    for sample in robots.samples(one.id, oracle)[:2]:
        q = sample.q
        qd = sample.qd
        J = jacobian(oracle, q, name, r)
        u = J[:3] @ qd
        row = oracle.to_pin(u @ J[:3] / norm(u))[None]
        after = pin.impulseDynamics(
            oracle.model,
            oracle.data,
            oracle.configuration(q),
            oracle.to_pin(qd),
            row,
            restitution,
            0.0,
        )
        result = dyn.impact(q, name, qd, u, r, restitution=restitution)
        close(
            result.qd_after,
            oracle.from_pin(after),
            100 * EPS * np.linalg.cond(oracle.mass_matrix(q)),
        )
        assert result.mass_speed == 0.0
        speed = norm(u)
        energy = 0.5 * result.reflected_mass * speed**2
        before = 0.5 * result.nu @ result.nu
        then = 0.5 * result.nu_after @ result.nu_after
        assert before - then == pytest.approx((1.0 - restitution**2) * energy, rel=1e-9)


def test_impact_with_a_free_mass():
    """Both masses part with e times the speed they met with; energy and momentum are accounted for;
    the rest of ν stays.
    """
    model = dd.load_urdf(robot(PANDA).urdf, armature=0.1)
    dyn = dd.DiagonalDynamics(model)
    rng = np.random.default_rng(8)
    q = model.random(rng)
    qd = rng.normal(size=model.nv)
    r = (0.0, 0.02, 0.1)
    u = dyn.link_velocity(q, "panda_hand", qd, r)[:3]
    for mass, e in ((4.0, 0.0), (40.0, 0.3), (0.6, 1.0)):
        result = dyn.impact(q, "panda_hand", qd, u, r, mass=mass, restitution=e)
        after = dyn.link_velocity(q, "panda_hand", result.qd_after, r)[:3] @ u / norm(u)
        assert result.mass_speed - after == pytest.approx(e * result.speed, abs=1e-10)
        assert result.impulse == pytest.approx(mass * result.mass_speed)
        K = [0.5 * nu @ nu for nu in (result.nu, result.nu_after)]
        assert K[0] - K[1] - 0.5 * mass * result.mass_speed**2 == pytest.approx(
            result.loss, rel=1e-9, abs=1e-12
        )
        w = dyn.epsilon_from_wrench(q, "panda_hand", [*u, 0, 0, 0], r)
        change = result.nu_after - result.nu
        close(change - w * (w @ change) / (w @ w), 0.0, 1e-12, 1.0)
    away = dyn.impact(q, "panda_hand", qd, -u, r)
    assert away.impulse == away.loss == 0.0
    np.testing.assert_array_equal(away.nu_after, away.nu)
    with pytest.raises(dd.InputError, match="restitution"):
        dyn.impact(q, "panda_hand", qd, u, restitution=1.2)
    with pytest.raises(dd.InputError, match="mass"):
        dyn.impact(q, "panda_hand", qd, u, mass=0.0)
    with pytest.raises(dd.InputError, match="qd are too large"):
        dyn.impact(q, "panda_hand", 1e200 * qd, u, r)
    with pytest.raises(dd.InputError, match="is too far away"):
        dyn.impact(q, "panda_hand", qd, u, np.full(3, 1e200))


# --- The transient model and limits
# ------------------------------------------------------------------------


LIMITS = """
regions:
  hand: {mass: 0.6, stiffness: 75000, force: 100, energy: 0.5}
  chest: {mass: clamped, stiffness: 25000, force: 200}
default: [chest]
links:
  panda_hand: [hand, chest]
  panda_link1: []
points:
  tip: {link: panda_hand, xyz: [0, 0, 0.1], regions: [hand]}
  elbow: {link: panda_link4}
"""


def test_limits_from_a_file(tmp_path):
    """Regions of links and points are those that the file says, others the default."""
    path = tmp_path / "limits.yaml"
    path.write_text(LIMITS)
    limits = dd.ContactLimits.load(path)
    assert limits.regions["chest"] == dd.BodyRegion(stiffness=25e3, force=200.0)
    model = dd.load_urdf(robot(PANDA).urdf)
    places = [
        *limits.contact_points(),
        *(dd.ContactPoint(n, n) for n in ("panda_hand", "panda_link1", "panda_link5")),
    ]
    points = dd.ContactPoints(model, places, limits)
    assert points.regions == (("hand",), ("chest",), ("hand", "chest"), (), ("chest",))
    assert points.limited.tolist() == [True, True, True, False, True]
    np.testing.assert_array_equal(points.points[0], [[0, 0, 0.1]])


@pytest.mark.parametrize("default", [None, ["chest"], []])
def test_a_bound_of_energy_is_on_every_link(default):
    """It is on links of any default, and leaves lower limits of a region."""
    limits = dd.ContactLimits(
        {"hand": {"energy": 0.2}, "chest": {"mass": 5.0}}, default, {"panda_hand": ["hand"]}
    ).with_energy(0.5)
    places = [(name, name) for name in ("panda_hand", "panda_link5")]
    points = dd.ContactPoints(dd.load_urdf(robot(PANDA).urdf), places, limits)
    lowest = [min(limits.regions[name].energy for name in names) for names in points.regions]
    assert points.limited.all() and lowest == [0.2, 0.2 if default is None else 0.5]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("regions: {a: {force: 100}}", "stiffness"),
        ("regions: {a: {stiffness: 75, force: 100}}", "stiffness is 75 N/m"),
        ("regions: {a: {energy: -1}}", "energy is -1"),
        ("regions: {a: {pressure: 1}}", "'pressure'"),
        ("regions: {a: {energy: 1}}\nlinks: {b: [c]}", "'c'"),
        ("limits: {}", "'limits'"),
        ("points: {tip: {xyz: [0, 0, 0]}}", "'tip' has no link"),
        ("geometry: cubes", "geometry is 'cubes'"),
        ("worst_by: luck", "worst_by is 'luck'"),
        ("- 1", "dict"),
    ],
)
def test_a_wrong_file_of_limits_is_named(tmp_path, text, said):
    path = tmp_path / "limits.yaml"
    path.write_text(text)
    with pytest.raises(dd.InputError, match=said) as error:
        dd.ContactLimits.load(path)
    assert str(path) in str(error.value)


def test_limits_of_a_link_that_there_is_not():
    limits = dd.ContactLimits({"a": {"energy": 1.0}}, links={"nowhere": ["a"]})
    with pytest.raises(dd.InputError, match="'nowhere'; expected"):
        dd.ContactPoints(dd.load_urdf(robot(PANDA).urdf), [], limits)


# --- Geometry
# ----------------------------------------------------------------------------------------------


OUTSIDE = 0.1
"""Largest relative distance of a hull from the surface of round shapes."""

SHAPES = {
    "box": '<box size="0.2 0.1 0.3"/>',
    "cylinder": '<cylinder radius="0.1" length="0.3"/>',
    "sphere": '<sphere radius="0.1"/>',
    "capsule": '<capsule radius="0.05" length="0.4"/>',
}
"""And how far a point of their surface is along a direction in their own axes."""

REACH = {
    "box": lambda u: np.abs(u) @ [0.1, 0.05, 0.15],
    "cylinder": lambda u: 0.1 * np.hypot(u[..., 0], u[..., 1]) + 0.15 * np.abs(u[..., 2]),
    "sphere": lambda u: 0.1 * np.ones(u.shape[:-1]),
    "capsule": lambda u: 0.05 + 0.2 * np.abs(u[..., 2]),
}


def with_shapes(*shapes):
    """Return an arm of one link with collision shapes a little away from its origin, and one behind
    it without any.
    """
    collision = "".join(
        f'<collision><origin xyz="0.1 {0.3 * k} 0" rpy="0.3 -0.2 1.1"/>'
        f"<geometry>{SHAPES[shape]}</geometry></collision>"
        for k, shape in enumerate(shapes)
    )
    inertia = {"mass": 1.0, "com": (0.1, 0, 0), "inertia": (0.01, 0, 0, 0.01, 0, 0.01)}
    return description(
        "shaped",
        link("base"),
        link("arm", **inertia).replace("</link>", f"{collision}</link>"),
        link("tip", **inertia),
        joint("shoulder", "revolute", "base", "arm"),
        joint("elbow", "revolute", "arm", "tip", xyz=(0.4, 0, 0)),
    )


@pytest.mark.parametrize(
    "shapes", [("box",), ("cylinder",), ("sphere",), ("capsule",), ("box", "sphere", "cylinder")]
)
def test_points_of_primitives_hold_them(shapes):
    """The hull of at most 64 points holds every shape in any direction, and is hardly larger."""
    urdf = with_shapes(*shapes)
    model = dd.load_urdf(urdf)
    result = dd.link_geometry(model, urdf)
    arm, tip = result.points
    assert len(arm.points) <= 64
    np.testing.assert_array_equal(tip.points, np.zeros((1, 3)))
    u = np.random.default_rng(0).normal(size=(4000, 3))
    u /= norm(u, axis=1)[:, None]
    R = pin.rpy.rpyToMatrix(0.3, -0.2, 1.1)
    reach = np.max(
        [u @ [0.1, 0.3 * k, 0.0] + REACH[s](u @ R) for k, s in enumerate(shapes)], axis=0
    )
    covered = (u @ np.asarray(arm.points).T).max(axis=1)
    size = np.ptp(np.asarray(arm.points), axis=0).max()
    assert (covered >= reach - 2e-3 * size).all()
    assert (covered <= reach + OUTSIDE * size).all()


def test_points_of_meshes(tmp_path):
    """The hulls of a real robot's meshes: at most as many points as are wanted, and all vertices
    within them.
    """
    import trimesh  # which reads the meshes of the library, too

    path = robots.robot_path(PANDA)
    model = dd.load_urdf(path)
    result = dd.link_geometry(model, path, "meshes", 40)
    assert not result.left_out and {point.link for point in result.points} <= set(model.link_names)
    assert max(len(point.points) for point in result.points) <= 40
    hand = next(point for point in result.points if point.name == "panda_hand")
    file = next(robots.robots_folder().rglob("collision/hand.stl"))
    vertices = np.asarray(trimesh.load(file).vertices)
    u = np.random.default_rng(0).normal(size=(500, 3))
    size = np.ptp(vertices, axis=0).max()
    assert (
        (u @ np.asarray(hand.points).T).max(axis=1)
        >= (u @ vertices.T).max(axis=1) - 2e-3 * size * norm(u, axis=1)
    ).all()
    frames = dd.link_geometry(model, path, "primitives")
    assert "meshes" in frames.left_out["panda_link1"]
    origins = {point.link: np.asarray(point.points)[0] for point in frames.points}
    assert not any(origins[link].any() for link in frames.left_out)  # frames of the link


# --- The worked example
# ------------------------------------------------------------------------------------


def test_example_limits_load_and_are_placeholders():
    """The file that is shipped is read as it stands; its regions say that they are nobody's."""
    limits = dd.ContactLimits.load(ROOT / "config/contact_limits.example.yaml")
    assert limits.regions and all(name.startswith("placeholder") for name in limits.regions)
    assert limits.regions["placeholder_clamped"].mass == math.inf and limits.default == (
        "placeholder_free",
    )
