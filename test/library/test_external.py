# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""External wrench and touched link from external torque, by definition: Pinocchio's Jacobian,
NumPy's decompositions.
"""

import itertools

import numpy as np
import pinocchio as pin
import pytest

import diag_dynamics as dd
import robots
from controlled import PANDA, RANDOM, UR5
from coupling import NAMED, oracle_of
from derivative_oracles import jacobian
from diag_dynamics.dynamics.contact_force import ContactForce
from diag_dynamics.exceptions import InputError

pytestmark = pytest.mark.filterwarnings("ignore::diag_dynamics.InertiaWarning")

ARM = PANDA._replace(
    id="panda_arm", locked_joints={"panda_finger_joint1": 0.02, "panda_finger_joint2": 0.02}
)
Z1 = robots.robot("z1_description/urdf/z1.urdf")
TEXTBOOK = {robot_id.id: robot_id for robot_id in robots.textbook_robots()}
ROBOTS = (
    ARM,
    UR5,
    PANDA._replace(id="panda+coupled", mimic="embed"),
    NAMED["parallel gripper"]._replace(mimic="embed"),
    TEXTBOOK["pendulum"],
    TEXTBOOK["gantry"],
    RANDOM["random_tree_0"],
    RANDOM["mobile_tree_20"],
    RANDOM["geared_tree_10"].floating,
)
POINT = (0.1, -0.2, 0.05)
WIDE = (1e4, 1e4)  # [N, N m]: all directions that move a joint are observed


class Case:
    """A robot, its oracle, one state, a random Σ, and links from the first moving one to the
    tips.
    """

    def __init__(self, one, seed=0):
        self.model = dd.load_urdf(one.urdf, mimic=one.mimic, **one.options)
        self.oracle = oracle_of(one, self.model.dof_names)
        self.dyn = dd.DiagonalDynamics(self.model)
        rng = np.random.default_rng(seed)
        self.q = robots.samples(one.id, self.oracle)[0].q
        n = self.model.nv
        size = np.exp(rng.uniform(-1.5, 1.0, n))
        self.covariance = np.cov(rng.normal(size=(n, 4 * n + 4))) * np.outer(
            size, size
        ) + 1e-3 * np.eye(n)
        moving = [name for name in self.model.link_names if self.J(name).any()]
        self.links = [moving[0], moving[len(moving) // 2], moving[-1]]
        self.tau = rng.normal(size=n)
        self.push = rng.normal(size=6) * [20, 20, 20, 3, 3, 3]

    def J(self, link, point=(0.0, 0.0, 0.0), frame="link"):
        return jacobian(self.oracle, self.q, link, point, frame)

    def information(self, J, scale):
        """S J Σ⁻¹ Jᵀ S of force and moment in units of `scale`."""
        S = np.diag(np.repeat(scale, 3))
        return S @ J @ np.linalg.solve(self.covariance, J.T) @ S


@pytest.fixture(scope="module", params=ROBOTS)
def case(request):
    return Case(request.param)


@pytest.mark.parametrize("frame", ["link", "world"])
def test_estimate_and_covariance(case, frame):
    """f̂ and its covariance are those of the generalized inverse of JΣ⁻¹Jᵀ over its observed
    eigenvectors.
    """
    for link in case.links:
        for scale in ((10.0, 1.0), (2.0, 0.3), (100.0, 100.0)):
            J = case.J(link, POINT, frame)
            S = np.diag(np.repeat(scale, 3))
            value, vector = np.linalg.eigh(case.information(J, scale))
            observed = value >= 1.0
            inverse = S @ (vector[:, observed] / value[observed]) @ vector[:, observed].T @ S
            expected = inverse @ J @ np.linalg.solve(case.covariance, case.tau)
            result = case.dyn.wrench(
                case.q,
                link,
                case.tau,
                case.covariance,
                point=POINT,
                frame=frame,
                max_deviation=scale,
            )
            size = np.abs(expected).max() + 1.0
            np.testing.assert_allclose(result.wrench, expected, rtol=1e-8, atol=1e-9 * size)
            unknown = (np.abs(vector[:, ~observed]) > 1e-6).any(axis=1)
            inverse[unknown, unknown] = np.inf
            np.testing.assert_allclose(
                result.covariance, inverse, rtol=1e-8, atol=1e-9 * (np.diag(S @ S).max() + 1)
            )
            np.testing.assert_array_equal(result.observed, observed[::-1])
            unexplained = case.tau - J.T @ expected
            chi_square = unexplained @ np.linalg.solve(case.covariance, unexplained)
            assert result.chi_square == pytest.approx(chi_square, rel=1e-8, abs=1e-9)


def test_directions(case):
    """Directions are eigenvectors, most precise first, with 1/√eigenvalue; they span what is not
    observed.
    """
    scale = (10.0, 1.0)
    for link in case.links:
        B = case.information(case.J(link), scale)
        value, vector = np.linalg.eigh(B)
        value = value[::-1]
        vector = vector[:, ::-1]
        result = case.dyn.wrench(case.q, link, case.tau, case.covariance, max_deviation=scale)
        U = result.directions / np.repeat(scale, 3)
        np.testing.assert_allclose(U @ U.T, np.eye(6), atol=1e-12)
        size = max(value[0], 1.0)
        np.testing.assert_allclose(U @ B @ U.T, np.diag(value), atol=1e-11 * size)
        assert all(a <= b * (1 + 1e-9) for a, b in itertools.pairwise(result.deviation))
        is_known = value > 1e-9 * size
        np.testing.assert_allclose(result.deviation[is_known], value[is_known] ** -0.5, rtol=1e-6)
        assert (result.deviation[~is_known] > 1e4 / np.sqrt(size)).all()
        hidden = U[~result.observed]
        expected = vector[:, value < 1.0]
        np.testing.assert_allclose(hidden.T @ hidden, expected @ expected.T, atol=1e-9 * size)
        np.testing.assert_allclose(hidden @ (result.wrench / np.repeat(scale, 3)), 0.0, atol=1e-9)


def test_force_alone(case):
    """With force_only the estimate is that of three rows of J; the moment is zero and counts as not
    observed.
    """
    for link in case.links:
        J = case.J(link, POINT)[:3]
        tau = J.T @ case.push[:3] + 0.1 * case.tau
        A = J @ np.linalg.solve(case.covariance, J.T)
        result = case.dyn.wrench(
            case.q, link, tau, case.covariance, point=POINT, force_only=True, max_deviation=WIDE
        )
        np.testing.assert_array_equal(result.wrench[3:], 0.0)
        assert not result.observed[3:].any() and result.observed.sum() == np.linalg.matrix_rank(
            J, 1e-9
        )
        assert not result.covariance[3:].any() and not result.covariance[:, 3:].any()
        inverse = np.linalg.pinv(A, rcond=1e-12, hermitian=True)
        np.testing.assert_allclose(
            J.T @ result.wrench[:3],
            J.T @ inverse @ J @ np.linalg.solve(case.covariance, tau),
            rtol=1e-6,
            atol=1e-7,
        )


@pytest.mark.parametrize("robot", [UR5, ARM], ids=["six joints", "seven joints"])
def test_without_covariance(robot):
    """Six joints have J⁻ᵀτ, seven the least squares of τ̂ − Jᵀf̂, at any deviation."""
    case = Case(robot)
    link = case.links[-1]
    J = case.J(link)
    for deviation in ((10.0, 1.0), (1e-3, 1e-3)):
        result = case.dyn.wrench(case.q, link, case.tau, max_deviation=deviation)
        expected = np.linalg.lstsq(J.T, case.tau, rcond=None)[0]
        np.testing.assert_allclose(result.wrench, expected, rtol=1e-9)
        np.testing.assert_allclose(result.covariance, np.linalg.inv(J @ J.T), rtol=1e-8)
        assert result.observed.all()


def test_batch_has_the_same_bits():
    """Many states in one thread or two have the bits of single states; results are read-only."""
    case = Case(PANDA)
    rng = np.random.default_rng(3)
    Q = np.array([case.model.random(rng) for _ in range(600)])
    TAU = rng.normal(size=(600, case.model.nv))
    options = {"point": POINT, "frame": "world"}
    for threads in (1, 2):
        many = case.dyn.wrench(Q, "panda_hand", TAU, case.covariance, threads=threads, **options)
        assert many.wrench.shape == (600, 6) and many.chi_square.shape == (600,)
        for t in range(0, 600, 37):
            single = case.dyn.wrench(Q[t], "panda_hand", TAU[t], case.covariance, **options)
            for a, b in zip(single, many, strict=True):
                np.testing.assert_array_equal(a, b[t])
    assert not any(array.flags.writeable for array in many)
    with pytest.raises(
        InputError, match=r"state 5: external_torque of joint 'panda_joint2' is nan"
    ):
        TAU[5, 1] = np.nan
        case.dyn.wrench(Q, "panda_hand", TAU)


@pytest.mark.parametrize(
    "change, message",
    [
        ({"covariance": np.eye(5)}, r"covariance is .*; expected finite numbers, shape \(6, 6\)"),
        (
            {"covariance": np.diag([1, 1, 1, 0, 1, 1.0])},
            r"covariance has the eigenvalue 0; expected all of them > 0",
        ),
        ({"covariance": np.eye(6) + np.eye(6, k=1)}, r"covariance is not symmetric"),
        ({"covariance": np.full((6, 6), np.nan)}, r"covariance is .*; expected finite numbers"),
        ({"max_deviation": (1.0, 0.0)}, "max_deviation of 'moment' is 0.0; expected a finite"),
        ({"frame": "tool"}, r"frame is 'tool'; expected one of 'link', 'world'"),
        ({"point": (1.0, 2.0)}, r"point is \(1.0, 2.0\); expected three finite numbers"),
        ({"link": "arm"}, r"arm"),
        ({"link": "base_link"}, r"link is 'base_link'; expected a link that a joint moves"),
        (
            {"external_torque": [np.inf] * 6},
            r"external_torque of joint 'shoulder_pan_joint' is inf",
        ),
        ({"external_torque": [1e300] * 6}, r"external_torque (is|are) too large"),
    ],
    ids=lambda value: None if isinstance(value, str) else next(iter(value)),
)
def test_errors_name_the_argument(change, message):
    case = Case(UR5)
    arguments = {
        "q": case.q,
        "external_torque": case.tau,
        "link": "wrist_3_link",
        "covariance": case.covariance,
    }
    with pytest.raises(InputError, match=message):
        case.dyn.wrench(**arguments | change)


@pytest.mark.parametrize(
    "change, message",
    [
        ({"significance": -1.0}, r"significance is -1.0; expected a number >= 0"),
        ({"significance": 1e300}, r"significance is 1e\+300; expected a number >= 0 and <= 1e9"),
        ({"forces": 1e200}, r"forces of '0' is 1e\+200; expected a finite number > 0 and <= 1e9"),
        ({"forces": (4.0, 0.0)}, r"forces of '1' is 0.0; expected a finite number > 0"),
        ({"forces": ()}, r"forces is \(\); expected"),
        ({"covariance": np.eye(5)}, r"covariance is .*; expected finite numbers, shape \(6, 6\)"),
        ({"external_torque": [1e300] * 6}, r"external_torque (is|are) too large"),
    ],
    ids=lambda value: None if isinstance(value, str) else next(iter(value)),
)
def test_errors_of_touched_link(change, message):
    case = Case(UR5)
    arguments = {"q": case.q, "external_torque": case.tau, "covariance": case.covariance}
    with pytest.raises(InputError, match=message):
        case.dyn.touched_link(**arguments | change)


# --- Touched link


def candidates(model, oracle):
    """Moving links, and of each the corners of its box in its own axes, from Pinocchio's frames and
    joints.
    """
    full = getattr(oracle, "full", oracle)
    frames = [f for f in full.model.frames if f.type == pin.FrameType.BODY]
    result = {}
    for joint in range(1, full.model.njoints):
        places = [f for f in frames if f.parentJoint == joint]
        link = min(places, key=lambda f: model.link_names.index(f.name))
        points = [f.placement.translation for f in places]
        points += [
            X.translation
            for k, X in enumerate(full.model.jointPlacements)
            if full.model.parents[k] == joint
        ]
        body = full.model.inertias[joint]
        points += [body.lever] if body.mass else []
        points = np.array([link.placement.actInv(p) for p in points])
        result[link.name] = points.min(axis=0) - 0.05, points.max(axis=0) + 0.05
    return {name: result[name] for name in model.link_names if name in result}


def posterior(case, tau, forces):
    """The probability of each link by dense Gaussians, the moments of the box's points by
    quadrature.
    """
    node = np.array([-1.0, 1.0]) / np.sqrt(3.0)  # exact for the squares of a uniform distribution
    evidence = {}
    for link, (low, high) in candidates(case.model, case.oracle).items():
        J = case.J(link)
        logs = []
        near = np.full(3, 0.05)
        for middle, half in ((0.5 * (low + high), 0.5 * (high - low)), (0.0 * near, near)):
            parts = []
            for corner in itertools.product(node, repeat=3):
                A = np.vstack([np.eye(3), pin.skew(middle + half * corner)])
                parts.append(J.T @ A @ A.T @ J / 3.0)
            for F in forces:
                C = case.covariance + F**2 * np.mean(parts, axis=0)
                logs.append(-0.5 * np.linalg.slogdet(C)[1] - 0.5 * tau @ np.linalg.solve(C, tau))
        evidence[link] = np.logaddexp.reduce(logs)
    logs = np.array(list(evidence.values()))
    p = np.exp(logs - logs.max())
    return tuple(evidence), p / p.sum()


def test_probability_of_each_link(case):
    """Bayes' rule with the dense Gaussians of the definition; the most probable link is named."""
    rng = np.random.default_rng(5)
    L = np.linalg.cholesky(case.covariance)
    for forces in ((4.0, 12.0, 36.0), (20.0,)):
        for link in case.links:
            tau = case.J(link, POINT)[:3].T @ (10.0 * rng.normal(size=3)) + L @ rng.normal(
                size=case.model.nv
            )
            result = case.dyn.touched_link(
                case.q, tau, case.covariance, significance=0.0, forces=forces
            )
            links, p = posterior(case, tau, forces)
            assert result.chi_square == pytest.approx(
                tau @ np.linalg.solve(case.covariance, tau), rel=1e-9
            )
            if not result.link:
                continue
            assert sorted(result.links) == sorted(links)
            places = [result.links.index(name) for name in links]
            np.testing.assert_allclose(result.probability[places], p, rtol=1e-6, atol=1e-9)
            assert result.confidence == result.probability.max()
            assert result.link == result.links[result.probability.argmax()]


@pytest.mark.parametrize("robot", [ARM, UR5, Z1])
def test_the_share_of_links_and_forces_that_are_right(robot):
    """Forces of 8 to 40 N at poses, links and points at random: the confidence is the share of
    right links in each tenth with 400 or more, and 68 % of the intervals have the force.

    Half of the points are near the origin of the link, the others along it.
    """
    model = dd.load_urdf(robot.urdf, mimic=robot.mimic, **robot.options)
    dyn = dd.DiagonalDynamics(model)
    oracle = oracle_of(robot, model.dof_names)
    rng = np.random.default_rng(2)
    count = 5_000
    boxes = list(candidates(model, oracle).items())
    deviation = 0.003 * model.effort_limit + 0.05
    Q = np.array([model.random(seed) for seed in range(count)])
    TAU = deviation * rng.normal(size=(count, model.nv))
    touched = rng.integers(len(boxes), size=count)
    size = rng.uniform(8.0, 40.0, size=count)
    for q, tau, number, magnitude in zip(Q, TAU, touched, size, strict=True):
        link, (low, high) = boxes[number]
        tip = np.where(np.abs(low) > np.abs(high), low + 0.05, high - 0.05)
        direction, force = rng.normal(size=(2, 3))
        direction *= 0.05 / np.linalg.norm(direction)
        force *= magnitude / np.linalg.norm(force)
        point = rng.uniform() * rng.integers(2) * tip + direction
        tau += jacobian(oracle, q, link, point)[:3].T @ force
    covariance = np.diag(deviation**2)
    result = dyn.touched_link(Q, TAU, covariance)
    is_right = result.link == np.array([boxes[number][0] for number in touched])
    tenth = np.floor(10.0 * result.confidence)
    checked = [k for k in range(1, 10) if (tenth == k).sum() >= 400]
    assert checked
    for k in checked:
        rows = tenth == k
        chance = 0.5 / np.sqrt(rows.sum())
        assert abs(result.confidence[rows].mean() - is_right[rows].mean()) < 0.05 + chance
    rows = result.link != ""
    low, high = ContactForce(model, covariance).interval(Q[rows], TAU[rows]).T
    is_inside = (low < size[rows]) & (size[rows] < high)
    assert abs(is_inside.mean() - 0.68) < 0.03 + 0.5 / np.sqrt(len(low))


def test_noise_alone_touches_no_link():
    """Below the quantile of χ² there is no link: of normal noise in all but 0.13 % of the
    samples.
    """
    case = Case(ARM)
    rng = np.random.default_rng(8)
    count = 40_000
    noise = rng.normal(size=(count, 7)) @ np.linalg.cholesky(case.covariance).T
    Q = np.tile(case.q, (count, 1))
    result = case.dyn.touched_link(Q, noise, case.covariance)
    assert result.chi_square.mean() == pytest.approx(7.0, rel=0.02)
    share = (result.link != "").mean()
    assert 0.0008 < share < 0.0019  # the tail beyond 3 σ is 0.00135
    np.testing.assert_allclose(result.probability.sum(axis=1), result.link != "", rtol=1e-14)
    np.testing.assert_array_equal(result.confidence == 0.0, result.link == "")
