# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Flexible links: virtual joints in Pinocchio, and beams in closed form."""

import pickle

import numpy as np
import pinocchio as pin
import pytest
import yaml
from scipy.integrate import quad
from scipy.linalg import eigh
from scipy.optimize import brentq

import diag_dynamics as dd
from accuracy import assert_close, norm
from coupling import upper_factor, upper_factor_rate
from diag_dynamics.exceptions import LoopError
from diag_dynamics.joint_states.robot_joints import joints_of
from diag_dynamics.model.link_modes import bending_energy
from diag_dynamics.simulation.plant import Plant
from perturbed import perturbed

G = np.array([0.3, -0.5, -9.81])


# --- Pinocchio, with virtual joints that follow modes
# -------------------------------------------------------------


class CutTree:
    """A robot in Pinocchio whose flexible links are chains of joints: x = L q + ½ qᵀ Q q, q of
    `model`.

    `joints` has name, parent, child, origin and type of each joint, and rigid points of its child.
    """

    def __init__(self, model, joints):
        self.model = model
        self.tree = pin.Model()
        self.L = []
        self.Q = []
        self.tree.gravity.linear = G
        identity = np.eye(3)
        at = {"base": 0}
        for name, parent, child, xyz, kind, points in joints:
            index = at[parent]
            placement = pin.SE3(identity, np.array(xyz, float))
            link = model.flexible_links.get(parent)
            if link and name in link.tips:
                index = self.add_chain(index, link, link.tips[name])
                placement = pin.SE3(link.axes.T, np.zeros(3))
            at[child] = self.add_joint(index, kind, placement, name)
            for mass, *point in points:
                place = pin.SE3(identity, np.array(point))
                self.tree.appendBodyToJoint(at[child], body(mass), place)
            link = model.flexible_links.get(child)
            for section in link.sections if link else ():
                end = self.add_chain(at[child], link, section)
                self.tree.appendBodyToJoint(
                    end, body(section.mass, section.inertia), pin.SE3.Identity()
                )

    def add_joint(self, parent, kind, placement, sources, linear=1.0, quadratic=0.0):
        """Add a joint that is a dof of the model, or follows some; return its index."""
        names = self.model.dof_names
        nv = self.model.nv
        at = [names.index(name) for name in np.atleast_1d(sources)]
        L = np.zeros(nv)
        Q = np.zeros((nv, nv))
        L[at] = linear
        Q[np.ix_(at, at)] = quadratic
        self.L.append(L)
        self.Q.append(Q)
        return self.tree.addJoint(parent, kind, placement, f"joint {len(self.L)}")

    def add_chain(self, joint, link, station):
        """Add the joints between the origin of a link and one of its stations; return the last
        one.
        """
        X = pin.JointModelPX()
        Y = pin.JointModelPY()
        Z = pin.JointModelPZ()
        placement = pin.SE3(link.axes, link.axes @ station.at)
        for kind, row, bent in zip(
            (X, Y, Z), station.shape, (-station.shortening, 0, 0), strict=True
        ):
            joint = self.add_joint(joint, kind, placement, link.modes, row, bent)
            placement = pin.SE3.Identity()
        turns = pin.JointModelRZ(), pin.JointModelRY(), pin.JointModelRX()
        for kind, row in zip(turns, station.slope[::-1], strict=True):
            joint = self.add_joint(joint, kind, placement, link.modes, row)
        return joint

    def compare(self, q, qd):
        """Compare K, ν, C and ε_g, with M = GᵀM_full G, and c with Ġ."""
        L = np.array(self.L)
        Q = np.array(self.Q)
        data = self.tree.createData()
        G = L + Q @ q
        G_rate = Q @ qd
        x = L @ q + 0.5 * (Q @ q) @ q
        rates = G @ qd
        full = pin.crba(self.tree, data, x)
        full = np.triu(full) + np.triu(full, 1).T
        C_s = pin.computeCoriolisMatrix(self.tree, data, x, rates)
        M = G.T @ full @ G
        change = G.T @ (C_s @ G + full @ G_rate)
        unit, D = upper_factor(M)
        m = unit * np.sqrt(D)
        c = G.T @ (C_s @ rates + full @ G_rate @ qd)
        coriolis = np.linalg.solve(m, c) - upper_factor_rate(m, change + change.T).T @ qd
        gravity = np.linalg.solve(m, G.T @ pin.computeGeneralizedGravity(self.tree, data, x))
        s = dd.DiagonalDynamics(self.model).evaluate(q, qd)
        assert s.kinetic_energy == pytest.approx(0.5 * qd @ M @ qd, rel=1e-12)
        assert_close(s.nu, m.T @ qd, 1e-12)
        assert_close(s.coriolis, coriolis, 1e-11)
        assert_close(s.gravity, gravity, 1e-11)
        assert abs(s.nu @ s.coriolis) < 1e-13 * norm(s.nu) * norm(coriolis)


def body(mass, inertia=(0.0, 0.0, 0.0)):
    return pin.Inertia(mass, np.zeros(3), np.diag(inertia))


# --- A robot of two flexible links, the second with a motor, and bodies at its tip and beside
# ---------------------

TIP = np.array(
    [
        [0.2, 0.01, 0.0, 0.05],
        [0.1, -0.03, 0.02, 0.0],
        [0.15, 0.02, 0.05, 0.1],
        [0.05, 0.0, -0.04, 0.06],
    ]
)
SIDE = np.array([[0.3, 0.1, 0.0, 0.0], [0.2, 0.0, 0.1, 0.05], [0.1, 0.05, 0.0, 0.1]])
MOTOR = np.array(
    [
        [0.4, 0.03, 0.0, 0.05],
        [0.3, 0.0, -0.04, 0.02],
        [0.2, -0.02, 0.01, 0.08],
        [0.1, 0.0, 0.05, 0.0],
    ]
)


def inertial(points, rod=0.0, vector=(0.0, 0.0, 0.0), polar=0.0):
    """Return <inertial> of points (mass, x, y, z), and a rod from the origin along a vector."""
    vector = np.asarray(vector)
    mass = points[:, 0].sum() + rod
    centre = (points[:, 0] @ points[:, 1:] + 0.5 * rod * vector) / mass
    moment = np.zeros((3, 3))
    for m, *p in points:
        moment += m * (np.dot(p, p) * np.eye(3) - np.outer(p, p))
    if rod:
        axis = np.outer(vector, vector) / (vector @ vector)
        moment += rod * (
            vector @ vector * np.eye(3) - np.outer(vector, vector)
        ) / 3.0 + 0.5 * polar * (np.eye(3) + axis)
    moment -= mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
    entries = " ".join(
        f'i{"xyz"[i]}{"xyz"[j]}="{float(moment[i, j])!r}"' for i in range(3) for j in range(i, 3)
    )
    xyz = " ".join(map(repr, centre.tolist()))
    return (
        f'<inertial><origin xyz="{xyz}"/><mass value="{float(mass)!r}"/><inertia {entries}/>'
        f"</inertial>"
    )


def joint(name, parent, child, xyz="0 0 0", axis="0 0 1", kind="continuous"):
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}"/><axis xyz="{axis}"/></joint>'
    )


SLANT, UP = np.array([0.7, 0.0, 0.2]), np.array([0.0, 0.0, 0.6])
POLAR = (MOTOR[:, 0] @ (MOTOR[:, 1] ** 2 + MOTOR[:, 2] ** 2)) * 0.6 / MOTOR[:, 0].sum()
ARM = (
    '<robot name="arm"><link name="base"/>'
    f'<link name="a">{inertial(np.zeros((0, 4)), 1.2, SLANT, 8e-4)}</link>'
    f'<link name="b">{inertial(MOTOR, 0.6, UP, POLAR)}</link>'
    f'<link name="tip">{inertial(TIP)}</link><link name="side">{inertial(SIDE)}</link>'
    + joint("j1", "base", "a")
    + joint("j2", "a", "b", "0.7 0 0.2", "0 1 0")
    + joint("j3", "b", "tip", "0 0 0.6", "1 0 0")
    + joint("k", "a", "side", axis="1 0 0")
    + "</robot>"
)
LINKS = {
    "a": {"tip": "j2", "EI": [60.0, 80.0], "GJ": 50.0, "modes": [2, 2, 1]},
    "b": {
        "tip": "j3",
        "EI": [57.0, 57.0],
        "modes": [2, 1, 1],
        "GJ": 30.0,
        "mass": 0.6,
    },
}


@pytest.fixture(scope="module")
def arm():
    return dd.load_urdf(ARM, loops={"flexible_links": LINKS}, gravity=G)


@pytest.mark.parametrize("seed", [0, 1])
def test_arm(arm, seed):
    """K, ν, C and ε_g with the foreshortening of beams, and points at their tips and beside."""
    rng = np.random.default_rng(seed)
    size = np.where(np.isfinite(arm.upper), arm.upper, 1.0)
    X = pin.JointModelRX()
    Y = pin.JointModelRY()
    Z = pin.JointModelRZ()
    joints = [
        ("j1", "base", "a", (0, 0, 0), Z, ()),
        ("k", "a", "side", (0, 0, 0), X, SIDE),
        ("j2", "a", "b", SLANT, Y, MOTOR),
        ("j3", "b", "tip", UP, X, TIP),
    ]
    CutTree(arm, joints).compare(arm.random(rng), rng.normal(size=arm.nv) * size)


# --- Beams in closed form
# -----------------------------------------------------------------------------------------

LENGTH, MASS, EI = 0.9, 1.3, 25.0
UNIT = np.sqrt(EI / MASS / LENGTH**3)


def beam(modes, payload=0.0, hub=None, polar=1e-3, **entry):
    """Return a beam along x; clamped in the world, or on a hub that turns about an axis."""
    payload_link = (
        f"<link name='end'>{inertial(np.array([[payload, 0, 0, 0]])) if payload else ''}</link>"
    )
    beam_link = (
        f'<link name="beam">{inertial(np.zeros((0, 4)), MASS, [LENGTH, 0, 0], polar)}</link>'
    )
    text = (
        '<robot name="beam">'
        + beam_link
        + payload_link
        + joint("end", "beam", "end", f"{LENGTH} 0 0", kind="fixed")
    )
    if hub:
        text += '<link name="base"/>' + joint("hub", "base", "beam", axis=hub)
    entry = {"tip": "end", "EI": [EI, 2.0 * EI], "modes": modes, "GJ": 7.0} | entry
    return dd.load_urdf(
        text + "</robot>", loops={"flexible_links": {"beam": entry}}, gravity=(0, 0, 0)
    )


def roots(characteristic, count):
    x = np.arange(0.2, 20.0, 0.01)
    y = characteristic(x)
    return np.array(
        [brentq(characteristic, x[k], x[k + 1]) for k in np.flatnonzero(y[1:] * y[:-1] < 0)][:count]
    )


@pytest.mark.parametrize("payload", [0.0, 0.5, 1.0])
def test_frequencies(payload):
    """Frequencies of the clamped beam, bare and with a payload, at four modes of a plane."""
    model = beam([4, 4, 0], payload * MASS)
    [link] = model.flexible_links.values()
    M = dd.DiagonalDynamics(model).mass_matrix(np.zeros(8))
    if not payload:
        assert np.abs(M - np.eye(8)).max() < 1e-10

    def characteristic(x):
        c = np.cos(x)
        s = np.sin(x)
        ch = np.cosh(x)
        sh = np.sinh(x)
        return 1.0 + c * ch + payload * x * (c * sh - s * ch)

    exact = roots(characteristic, 2) ** 2 * UNIT
    for k, factor in ((0, 1.0), (4, np.sqrt(2.0))):
        plane = slice(k, k + 4)
        result = np.sqrt(
            eigh(np.diag(link.frequencies[plane] ** 2), M[plane, plane], eigvals_only=True)
        )
        assert abs(result[0] / (factor * exact[0]) - 1.0) < 1e-5
        assert abs(result[1] / (factor * exact[1]) - 1.0) < 1e-2
    assert link.frequencies[0] != pytest.approx(link.frequencies[4], rel=0.1)


def test_torsion():
    """Frequencies of torsion of a clamped beam, (k − ½)π √(GJ/I_p L)."""
    model = beam([0, 0, 4])
    result = model.flexible_links["beam"].frequencies
    exact = (np.arange(2) + 0.5) * np.pi * np.sqrt(7.0 / 1e-3 / LENGTH)
    assert abs(result[0] / exact[0] - 1.0) < 1e-6
    assert abs(result[1] / exact[1] - 1.0) < 1e-2


@pytest.mark.parametrize("payload", [0.0, 0.4])
def test_static_deflection(payload):
    """A force at the tip bends the beam by F L³/3EI and F L²/2EI, and its slope turns the tip."""
    model = beam([3, 3, 0], payload)
    [link] = model.flexible_links.values()
    force = np.array([0.0, 0.02, -0.03])
    J = link.tips["end"].shape
    moved = dd.DiagonalDynamics(model).placement(J.T @ force / link.frequencies**2, "end")
    moved[0, 3] -= LENGTH
    flexibility = LENGTH**3 / 3.0 / EI * np.array([0.0, 1.0, 0.5])
    assert np.abs(moved[1:3, 3] - (flexibility * force)[1:]).max() < 1e-9 * LENGTH
    slope = np.array([0.0, -0.5 * force[2], force[1]]) * LENGTH**2 / 2.0 / EI
    rotation = 0.5 * np.array(
        [moved[2, 1] - moved[1, 2], moved[0, 2] - moved[2, 0], moved[1, 0] - moved[0, 1]]
    )
    assert np.abs(rotation - slope).max() < 1e-6
    assert moved[0, 3] == pytest.approx(
        -0.6 * ((flexibility * force) ** 2).sum() / LENGTH, rel=1e-6
    )


def strain_energy(link, eta):
    """Return ½ Σ ω²η² + U₄₆ [J]."""
    linear = 0.5 * float(((link.frequencies * eta) ** 2).sum())
    return linear + bending_energy(*(link.bends @ eta).T)


def test_large_bending():
    """The strain energy is that of an inextensible curve to eighth order, and efforts are its
    gradient.
    """
    [link] = beam([3, 2, 1]).flexible_links.values()
    [tip] = link.tips.values()
    eta = np.zeros(6)
    eta[0] = 0.1 / tip.slope[2, 0]

    def shape(x, k):  # the first mode from a beam's powers, by its values at the sections
        return np.polyval(np.polyder(curve, k), x)

    at = [entry.at[0] for entry in (*link.sections, tip)]
    values = [entry.shape[1, 0] for entry in (*link.sections, tip)]
    powers = np.linalg.lstsq(np.power.outer(at, np.arange(2, 5)), values, rcond=None)[0]
    curve = np.array([*powers[::-1], 0.0, 0.0]) * eta[0]
    exact = quad(lambda x: 0.5 * EI * shape(x, 2) ** 2 / (1.0 - shape(x, 1) ** 2), 0.0, LENGTH)[0]
    linear = 0.5 * (link.frequencies[0] * eta[0]) ** 2
    assert abs(strain_energy(link, eta) - exact) < 2e-4 * (exact - linear)
    eta = np.array([0.02, 0.01, 0.003, -0.02, 0.01, 0.001])
    step = 1e-5
    for k, entry in enumerate(np.eye(6)):
        values = [strain_energy(link, eta + x * step * entry) for x in (-2, -1, 1, 2)]
        slope = (values[0] - 8 * values[1] + 8 * values[2] - values[3]) / (12 * step)
        assert (
            abs(link.effort(eta, np.zeros(6))[k] + slope)
            < 1e-9 * np.abs(link.effort(eta, np.zeros(6))).max()
        )


# --- Motion
# --------------------------------------------------------------------------------------------------


def test_energy_in_motion(arm):
    """Energy is kept to the square of the step; damping takes what the audit says."""
    q = 0.4 * arm.random(6)
    residuals = []
    for step in (1e-3, 5e-4):
        sim = dd.Simulation(arm, q, step=step)
        sim.advance(steps=round(0.2 / step))
        residuals.append(abs(sim.audit.residual) / sim.elastic_energy)
    assert residuals[1] < 1e-2
    assert residuals[0] / residuals[1] > 3.0
    assert sim.audit.loss == pytest.approx(0.0, abs=1e-12)
    assert sim.elastic_energy == pytest.approx(
        sum(
            strain_energy(link, sim.q[[arm.dof_names.index(m) for m in link.modes]])
            for link in arm.flexible_links.values()
        )
    )
    damped = LINKS["a"] | {"damping_ratio": 0.05}
    model = dd.load_urdf(ARM, loops={"flexible_links": {"a": damped}}, gravity=G)
    sim = dd.Simulation(model, step=1e-4)
    sim.advance(steps=1000)
    assert sim.audit.loss < -1e-4
    assert abs(sim.audit.residual) < 1e-2 * -sim.audit.loss


@pytest.mark.parametrize("ratio", [0.0, 0.3, 0.9])
def test_decay(ratio):
    """A small mode moves as a damped oscillator through zero and back, and the audit has its
    loss.
    """
    model = beam([1, 0, 0], damping_ratio=ratio)
    [link] = model.flexible_links.values()
    [omega] = link.frequencies
    rate = omega * np.sqrt(1.0 - ratio**2)
    sim = dd.Simulation(model, qd=[1e-4 * omega], step=0.002 / omega)
    for _ in range(60):
        sim.advance(steps=50)
        expected = 1e-4 * omega / rate * np.exp(-ratio * omega * sim.time) * np.sin(rate * sim.time)
        assert abs(sim.q[0] - expected) < 1e-5 * 1e-4
    start = 0.5 * (1e-4 * omega) ** 2
    change = sim.kinetic_energy + sim.elastic_energy - start
    assert abs(sim.audit.loss - change) < 1e-9 * start


def test_motion_is_that_of_modal_efforts(arm):
    """A simulation accelerates as forward dynamics with the modes' efforts."""
    step = 1e-8
    q = 0.5 * arm.random(7)
    qd = 0.3 * arm.random(8)
    sim = dd.Simulation(arm, q, qd, step=step)
    tau = np.zeros(arm.nv)
    sim.advance(tau)
    qdd = dd.DiagonalDynamics(arm).forward_dynamics(q, qd, tau + arm.modal_effort(q, qd))
    assert np.abs((sim.qd - qd) / step - qdd).max() < 1e-5 * np.abs(qdd).max()


def test_steep_tip(arm):
    """A slope above 0.3 rad is a warning that names the link."""
    q = np.zeros(arm.nv)
    q[arm.dof_names.index("b/y1")] = 1.2 * arm.upper[arm.dof_names.index("b/y1")]
    sim = dd.Simulation(arm, q)
    with pytest.warns(dd.ModelWarning, match="flexible link 'b' exceeds 0.3 rad"):
        sim.advance(steps=1)


# --- Input
# --------------------------------------------------------------------------------------------------

WRONG = [
    ({"ghost": {}}, "'ghost'; expected"),
    ({"a": {"tip": "j2"}}, "flexible link 'a' has no EI"),
    ({"a": LINKS["a"] | {"stiff": 1}}, "flexible link 'a' has 'stiff'; expected one of tip"),
    ({"a": LINKS["a"] | {"tip": "k"}}, "joint 'k' is at its origin"),
    ({"a": LINKS["a"] | {"modes": [7, 0, 0]}}, "modes are"),
    ({"a": LINKS["a"] | {"EI": [1.0, -1.0]}}, "a finite number > 0 [N m²]"),
    ({"a": LINKS["a"] | {"damping_ratio": -0.1}}, "damping_ratio"),
    (
        {"a": LINKS["a"] | {"mass": 2.0}},
        "the mass of its modes is 2 kg; expected no more than its 1.2 kg",
    ),
    (
        {"b": {key: x for key, x in LINKS["b"].items() if key != "mass"}},
        "Give the mass of the beam",
    ),
    ({"base": LINKS["a"] | {"tip": "j1"}}, "'base' has no mass"),
]


@pytest.mark.parametrize(("entry", "text"), WRONG)
def test_wrong_input(entry, text):
    with pytest.raises(dd.InputError) as error:
        dd.load_urdf(ARM, loops={"flexible_links": entry})
    assert text in str(error.value)


def test_file(tmp_path, arm):
    """A YAML file has the same model, and a pickled one too."""
    path = tmp_path / "links.yaml"
    path.write_text(yaml.safe_dump({"flexible_links": LINKS}))
    q = arm.random(9)
    expected = dd.DiagonalDynamics(arm).mass_matrix(q)
    for model in (dd.load_urdf(ARM, loops=path, gravity=G), pickle.loads(pickle.dumps(arm))):
        assert (dd.DiagonalDynamics(model).mass_matrix(q) == expected).all()


def test_what_is_rejected(arm):
    """Joint states have no modes; none of these joints can be locked, and no loop passes through a
    flexible link.
    """
    with pytest.raises(dd.UnsupportedError, match="flexible link 'a'"):
        joints_of(arm)
    with pytest.raises(dd.UnsupportedError, match="link 'a' is flexible"):
        Plant(arm, {})
    body = {"mass": 1.0, "com": [0, 0, 0], "inertia": np.eye(3).tolist()}
    with pytest.raises(dd.InputError, match="link 'b' is flexible"):
        arm.with_parameters({"links": {"b": body}})
    assert perturbed(arm, 0.1, 1).total_mass != arm.total_mass
    loaded = dd.load_urdf(
        ARM,
        loops={"flexible_links": LINKS},
        parameters={"links": {"b": body | {"com": [0, 0, 0.3]}}},
    )
    assert loaded.total_mass == pytest.approx(dd.load_urdf(ARM).total_mass - 1.6 + 1.0)
    for name in ("a/tip/y", "a/y1"):
        with pytest.raises(dd.InputError, match=f"'{name}' is of a flexible link"):
            arm.with_locked_joints({name: 0.0})
    loop = {"name": "rope", "a": {"link": "side"}, "b": {"link": "tip"}}
    with pytest.raises(
        LoopError, match="loop 'rope': joint 'a/tip/rx' in it is of a flexible link"
    ):
        dd.load_urdf(ARM, loops={"flexible_links": LINKS, "loops": [loop]})
