# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A model is immutable: payloads, gravity and locks give a new one, the old one stays as it was, byte for byte."""

import copy
import ctypes
import gc
import pickle

import numpy as np
import pytest

import diag_dynamics as dd
import robots
from accuracy import assert_close, norm, tolerance
from diag_dynamics import sweeps
from oracles import Oracle

PANDA = "panda_description/urdf/panda.urdf"
PAYLOAD = {"mass": 2.0, "com": (0.05, -0.02, 0.1), "inertia": np.diag([0.02, 0.03, 0.04])}


def load(**options):
    return dd.load_urdf(robots.robot_path(PANDA), mimic="free", **options)


@pytest.fixture(scope="module")
def panda():
    return load()


@pytest.fixture(scope="module", params=[False, True], ids=["fixed", "floating"])
def everything(request):
    """Return a model with one of everything."""
    return load(
        floating_base=request.param,
        gravity=(1.0, 2.0, 3.0),
        locked_joints={"panda_joint3": 0.4},
        armature={"panda_joint1": 0.3},
        payloads={"panda_hand": (1.5, (0.0, 0.0, 0.1)), "panda_link2": tuple(PAYLOAD.values())},
    )


def fields(model) -> dict:
    """Return every public field as something that can be compared: arrays as their bytes."""
    found = {}
    for name, value in vars(model).items():
        if isinstance(value, np.ndarray):
            found[name] = (value.dtype.descr, value.shape, value.tobytes())
        elif name == "payloads":
            found[name] = {link: [np.array(part).tobytes() for part in payload] for link, payload in value.items()}
        elif not name.startswith("_"):
            found[name] = dict(value) if name == "locked_joints" else value
    return found


def answers(model) -> list[bytes]:
    """Return what the model makes of a state, to the bit."""
    dyn = dd.DiagonalDynamics(model)
    qd, tau = np.random.default_rng(3).standard_normal((2, model.nv))
    q = model.neutral + 0.2 * np.array([not name.startswith("root_joint/q") for name in model.coordinate_names])
    s = dyn.evaluate(q, qd, tau, friction=True)
    parts = (s.nu, s.xi, s.epsilon, s.coriolis, s.gravity, s.friction, s.link_energy, dyn.factors(q).m)
    return [part.tobytes() for part in parts]


CHANGES = {
    "gravity": lambda model: model.with_gravity((0.0, 1.0, -1.62)),
    "payload": lambda model: model.with_payload("panda_link5", **PAYLOAD),
    "payload taken off": lambda model: model.without_payload("panda_hand"),
    "lock": lambda model: model.with_locked_joints({"panda_joint2": 0.3, "panda_joint5": -1.0}),
    "release": lambda model: model.with_locked_joints({}),
    "parameters": lambda model: model.with_parameters(
        {"joints": {"panda_joint4": {"damping": 3.0, "effort_offset": 0.1, "armature": 0.2}}}
    ),
}

# What each change leaves alone is not copied but shared.
ALL = (
    "gravity",
    "lower",
    "upper",
    "velocity_limit",
    "effort_limit",
    "damping",
    "friction",
    "effort_offset",
    "bodies",
    "links",
)
SHARED = {
    "gravity": ALL[1:],
    "payload": ALL[:8],
    "payload taken off": ALL[:8],
    "lock": ("gravity",),
    "release": ("gravity",),
    "parameters": ("gravity",),
}


@pytest.mark.parametrize("change", CHANGES)
def test_a_change_gives_a_new_model(everything, change):
    """The old one keeps every byte and every answer; the new one has its own, and shares what is the same."""
    before, said = fields(everything), answers(everything)
    new = CHANGES[change](everything)
    assert new is not everything
    assert fields(new) != before
    assert answers(new) != said
    assert fields(everything) == before
    assert answers(everything) == said
    for name in SHARED[change]:
        assert getattr(new, name) is getattr(everything, name), name


@pytest.mark.parametrize("change", ["none", *CHANGES, "pickle", "deepcopy"])
def test_every_array_is_read_only(everything, change):
    more = {"none": lambda model: model, "pickle": lambda model: pickle.loads(pickle.dumps(model))}
    model = (CHANGES | more | {"deepcopy": copy.deepcopy})[change](everything)
    arrays = {name: value for name, value in vars(model).items() if isinstance(value, np.ndarray)}
    assert set(ALL) <= set(arrays)
    arrays |= {f"{link}.{i}": p for link, payload in model.payloads.items() for i, p in enumerate(payload) if i}
    arrays["armature"] = model.armature
    for name, array in arrays.items():
        assert not array.flags.writeable, name
        assert array.base is None or not array.base.flags.writeable, name
    for mapping in (model.payloads, model.locked_joints):
        with pytest.raises(TypeError):
            mapping["panda_link1"] = 1.0
    with pytest.raises(AttributeError):
        model.gravity = np.zeros(3)
    model.neutral[:] = 7.0  # this one is made anew each time
    assert (model.neutral != 7.0).all()


def test_arguments_are_copied():
    """Whoever changes his own array or dict later changes no model."""
    gravity, com, inertia = np.array([0.0, 0.0, -9.81]), np.array([0.1, 0.0, 0.0]), np.eye(3)
    payloads, locked = {"panda_hand": (1.0, com, inertia)}, {"panda_joint1": 0.1}
    armature = {"panda_joint2": 0.1}
    model = load(gravity=gravity, payloads=payloads, locked_joints=locked, armature=armature)
    other = model.with_gravity(gravity).with_payload("panda_link2", 1.0, com, inertia).with_locked_joints(locked)
    before = fields(model), fields(other)
    for array in (gravity, com, inertia):
        array[:] = 0.5
    for mapping in (payloads, locked, armature):
        mapping.clear()
    assert (fields(model), fields(other)) == before
    assert fields(other.with_locked_joints({"panda_joint1": 0.1})) == before[1]


@pytest.mark.parametrize("way", ["pickle", "deepcopy", "copy"])
def test_round_trip(everything, way):
    """What comes back is the same, to the bit, and can be changed in the same ways."""
    ways = {"pickle": lambda model: pickle.loads(pickle.dumps(model)), "deepcopy": copy.deepcopy, "copy": copy.copy}
    back = ways[way](everything)
    assert fields(back) == fields(everything)
    assert answers(back) == answers(everything)
    for change in CHANGES.values():
        assert fields(change(back)) == fields(change(everything))


# --- there and back again


def test_payload_changed_and_taken_off(everything):
    """Nothing is left of it, not even rounding."""
    before, said = fields(everything), answers(everything)
    loaded = everything.with_payload("panda_link5", 3.0, (0.1, 0.2, 0.3))
    changed = loaded.with_payload("panda_link5", 1e6)
    back = changed.without_payload("panda_link5")
    assert fields(back) == before
    assert answers(back) == said
    for mass in (1.0, 1e-3, 1e3):
        everything = everything.with_payload("panda_hand", mass).with_payload("panda_link7", mass, (0, 0, 0.1))
    everything = everything.without_payload("panda_link7").with_payload("panda_hand", 1.5, (0.0, 0.0, 0.1))
    assert fields(everything) == before


def test_locked_and_released(panda):
    """Locks are not added to those that are there but take their place; order and route do not matter."""
    one = panda.with_locked_joints({"panda_joint1": 0.2, "panda_joint4": -1.0})
    other = panda.with_locked_joints({"panda_joint6": 1.0}).with_locked_joints(
        {"panda_joint4": -1.0, "panda_joint1": 0.2}
    )
    assert dict(one.locked_joints) == dict(other.locked_joints) == {"panda_joint1": 0.2, "panda_joint4": -1.0}
    assert fields(one) == fields(other)
    assert answers(one) == answers(load(locked_joints={"panda_joint4": -1.0, "panda_joint1": 0.2}))
    assert fields(one.with_locked_joints({})) == fields(panda)
    assert answers(one.with_locked_joints({})) == answers(panda)


def test_changes_commute(panda):
    """Payload, gravity and locks are the same in any order, and the same as options of the loader."""
    at_once = load(
        gravity=(0.0, 3.0, 0.0),
        locked_joints={"panda_joint2": 0.3},
        payloads={"panda_hand": tuple(PAYLOAD.values())},
    )

    def payload(model):
        return model.with_payload("panda_hand", **PAYLOAD)

    def gravity(model):
        return model.with_gravity((0.0, 3.0, 0.0))

    def lock(model):
        return model.with_locked_joints({"panda_joint2": 0.3})

    for first, second, third in (
        (payload, gravity, lock),
        (lock, payload, gravity),
        (gravity, lock, payload),
        (lock, gravity, payload),
    ):
        model = third(second(first(panda)))
        assert fields(model) == fields(at_once)
        assert answers(model) == answers(at_once)


def test_armature_of_a_locked_joint_waits():
    """A joint that is locked and released has the armature it had."""
    model = load(armature=0.2)
    locked = model.with_locked_joints({"panda_joint1": 0.3})
    assert locked.armature.tolist() == [0.2] * 8
    assert fields(locked.with_locked_joints({})) == fields(model)


# --- payloads and locks are what they claim to be


@pytest.mark.parametrize("floating", [False, True], ids=["fixed", "floating"])
def test_payload_and_locks_against_pinocchio(floating):
    """Pinocchio with the body appended to the joint, and reduced by the locked joints."""
    locked = {"panda_joint2": 0.7, "panda_finger_joint1": 0.02}
    model = load(floating_base=floating, locked_joints=locked).with_payload("panda_hand", **PAYLOAD)
    oracle = Oracle(robots.robot(PANDA).urdf, model.dof_names, floating_base=floating, locked_joints=locked)
    oracle.append_body("panda_hand", **PAYLOAD)
    dyn = dd.DiagonalDynamics(model)
    assert model.locked_joints == locked
    for q, qd, tau, qdd in robots.samples("locked", oracle):
        t, s = oracle.at(q, qd, tau), dyn.evaluate(q, qd, tau)
        assert_close(s.nu, t.nu, tolerance(t))
        assert_close(s.epsilon, t.epsilon, tolerance(t))
        assert_close(s.coriolis, t.coriolis, tolerance(t), t.coriolis_scale)
        assert_close(s.gravity, t.gravity, tolerance(t))
        assert_close(s.kinetic_energy, t.kinetic_energy, 1e-12)
        tau_needed, unit = oracle.inverse_dynamics(q, qd, qdd), np.sqrt(np.diag(t.M))
        assert_close(dyn.inverse_dynamics(q, qd, qdd) / unit, tau_needed / unit, tolerance(t))
        without = dd.DiagonalDynamics(model.without_payload("panda_hand")).evaluate(q, qd, tau)
        assert norm(s.nu - without.nu) > 1e-3 * norm(s.nu)


def test_payload_of_a_locked_and_fixed_link_counts_at_its_place():
    """On the root of a fixed base a payload changes the total mass and nothing else."""
    panda = load()
    loaded = panda.with_payload("panda_link0", 5.0, (1.0, 2.0, 3.0))
    assert loaded.total_mass == panda.total_mass + 5.0
    assert answers(loaded) == answers(panda)


HELD = robots.description(
    "held",
    robots.link("base"),
    robots.link("arm", mass=1.0, com=(0.1, 0, 0), inertia=(0.1, 0, 0, 0.1, 0, 0.1)),
    robots.link("tip"),
    robots.joint("swing", "revolute", "base", "arm"),
    robots.joint("twist", "revolute", "arm", "tip", axis=(0, 1, 0)),
)


def test_what_massless_lock_holds_stays_held():
    """A payload neither frees a joint that was held nor is its loss an error, and copies are of the same robot."""
    held = dd.load_urdf(HELD, massless="lock")
    loaded = held.with_payload("tip", 1.0, (0.1, 0, 0))
    for model in (
        held,
        loaded,
        pickle.loads(pickle.dumps(loaded)),
        copy.deepcopy(loaded),
        loaded.without_payload("tip"),
    ):
        assert model.dof_names == ("swing",)
        assert dict(model.locked_joints) == {"twist": 0.0}
    # Decided anew only where locks are.
    assert loaded.with_locked_joints({}).dof_names == ("swing", "twist")


def test_rotated_payload_is_symmetric_enough():
    """Rounding of a rotated inertia is no asymmetry."""
    model = dd.load_urdf(HELD, massless="lock")
    rng = np.random.default_rng(1)
    for _ in range(20):
        turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        inertia = turn @ np.diag([0.1, 0.1, 0.1]) @ turn.T
        kept = model.with_payload("tip", 1.0, inertia=inertia).payloads["tip"].inertia
        np.testing.assert_array_equal(kept, kept.T)


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, lambda dyn: pickle.loads(pickle.dumps(dyn))])
def test_copies_of_dynamics_work_in_memory_of_their_own(copied):
    """What a sweep works in lies at an address: a copy must not take it along."""
    dyn = dd.DiagonalDynamics(load())
    q, qd = np.full(dyn.model.nq, 0.1), np.ones(dyn.model.nv)
    expected = dyn.evaluate(q, qd).coriolis
    twin = copied(dyn)
    assert not np.shares_memory(twin._workspace.work, dyn._workspace.work)
    assert twin._robot == twin._workspace.robot != dyn._robot
    del dyn
    gc.collect()
    np.testing.assert_array_equal(twin.evaluate(q, qd).coriolis, expected)


def test_copied_workspace_lies_elsewhere():
    own = sweeps.Workspace(load().bodies, np.zeros(3))
    for twin in (copy.copy(own), copy.deepcopy(own), pickle.loads(pickle.dumps(own))):
        assert twin.robot != own.robot and twin.work.ctypes.data != own.work.ctypes.data
        words = (ctypes.c_int64 * (sweeps.workspace.ROBOT.dtype.itemsize // 8)).from_address(twin.robot)
        table = np.frombuffer(words, sweeps.workspace.ROBOT.dtype)[0]
        for name in ("bodies", "gravity", "work", "table"):
            array = getattr(twin, name)
            assert table[name].tolist() == [array.ctypes.data, *array.shape]


def test_byte_order_is_not_mistaken():
    """numba takes swapped bytes for plain numbers once it has seen an array that is not aligned."""
    dyn = dd.DiagonalDynamics(load())
    n = dyn.model.nv
    q, qd, tau = np.random.default_rng(0).uniform(-1.0, 1.0, (3, n))
    record = np.zeros(1, np.dtype([("flag", "u1"), ("q", "<f8", (n,))]))
    unaligned = record[0]["q"]
    unaligned[:] = q
    methods = {
        "evaluate": lambda *x: dyn.evaluate(*x).coriolis,
        "forward_dynamics": dyn.forward_dynamics,
        "factors": lambda q, *_: dyn.factors(q).m,
    }
    for method in methods.values():
        expected = method(q, qd, tau)
        for given in (unaligned, q.astype(">f8"), list(q)):
            np.testing.assert_array_equal(method(given, qd, tau), expected)
        for swapped in ((q.astype(">f8"), qd.astype(">f8"), tau.astype(">f8")), (q, qd, tau.astype(">f8"))):
            np.testing.assert_array_equal(method(*swapped), expected)
