# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A model is immutable: payloads, gravity, locks and parameters give a new one; the old one keeps
every byte.
"""

import copy
import gc
import itertools
import os
import pickle
import subprocess
import sys

import numpy as np
import pytest

import diag_dynamics as dd
import robots
from described import PANDA

PAYLOAD = {"mass": 2.0, "com": (0.05, -0.02, 0.1), "inertia": np.diag([0.02, 0.03, 0.04])}
COPIES = {
    "copy": copy.copy,
    "deepcopy": copy.deepcopy,
    "pickle": lambda value: pickle.loads(pickle.dumps(value)),
}


def load(**options):
    return dd.load_urdf(robots.robot_path(PANDA), mimic="free", **options)


@pytest.fixture(scope="module")
def panda():
    return load()


@pytest.fixture(scope="module", params=[False, True], ids=["fixed", "floating"])
def with_all(request):
    """Return a model with one of each option."""
    return load(
        floating_base=request.param,
        gravity=(1.0, 2.0, 3.0),
        locked_joints={"panda_joint3": 0.4},
        armature={"panda_joint1": 0.3},
        payloads={"panda_hand": (1.5, (0.0, 0.0, 0.1)), "panda_link2": tuple(PAYLOAD.values())},
    )


def fields(model):
    """Return every public field as something that can be compared: arrays as their bytes."""
    result = {}
    for name, value in vars(model).items():
        if isinstance(value, np.ndarray):
            result[name] = (value.dtype.descr, value.shape, value.tobytes())
        elif name == "payloads":
            result[name] = {
                link: [np.array(part).tobytes() for part in payload]
                for link, payload in value.items()
            }
        elif name != "description" and not name.startswith("_"):
            result[name] = dict(value) if name == "locked_joints" else value
    return result


def answers(model):
    """Return the results at one state, to the bit."""
    dyn = dd.DiagonalDynamics(model)
    qd, tau = np.random.default_rng(3).standard_normal((2, model.nv))
    q = model.neutral + 0.2 * np.array(
        [not name.startswith("root_joint/q") for name in model.coordinate_names]
    )
    s = dyn.evaluate(q, qd, tau, friction=True)
    parts = (
        s.nu,
        s.xi,
        s.epsilon,
        s.coriolis,
        s.gravity,
        s.friction,
        s.link_energy,
        dyn.factors(q).m,
    )
    return [part.tobytes() for part in parts]


def assert_same(one, other):
    assert fields(one) == fields(other)
    assert answers(one) == answers(other)


CHANGES = {
    "gravity": lambda model: model.with_gravity((0.0, 1.0, -1.62)),
    "payload": lambda model: model.with_payload("panda_link5", **PAYLOAD),
    "payload removed": lambda model: model.without_payload("panda_hand"),
    "lock": lambda model: model.with_locked_joints({"panda_joint2": 0.3, "panda_joint5": -1.0}),
    "release": lambda model: model.with_locked_joints({}),
    "parameters": lambda model: model.with_parameters(
        {"joints": {"panda_joint4": {"damping": 3.0, "effort_offset": 0.1, "armature": 0.2}}}
    ),
}


@pytest.mark.parametrize("change", CHANGES)
def test_change_gives_a_new_model(with_all, change):
    fields_before = fields(with_all)
    answers_before = answers(with_all)
    new = CHANGES[change](with_all)
    assert fields(new) != fields_before and answers(new) != answers_before
    assert fields(with_all) == fields_before and answers(with_all) == answers_before
    assert (
        with_all.with_gravity(with_all.gravity).bodies is with_all.bodies
    )  # what does not change is shared


@pytest.mark.parametrize("change", ["none", *CHANGES, "pickle", "deepcopy"])
def test_arrays_are_read_only(with_all, change):
    model = (CHANGES | COPIES | {"none": lambda model: model})[change](with_all)
    arrays = {name: value for name, value in vars(model).items() if isinstance(value, np.ndarray)}
    assert {
        "gravity",
        "lower",
        "effort_limit",
        "damping",
        "effort_offset",
        "bodies",
        "links",
    } <= set(arrays)
    arrays |= {
        f"{link}.{i}": p
        for link, payload in model.payloads.items()
        for i, p in enumerate(payload)
        if i
    }
    arrays["armature"] = model.armature
    for name, array in arrays.items():
        assert not array.flags.writeable, name
        assert array.base is None or not array.base.flags.writeable, name
    for mapping in (model.payloads, model.locked_joints):
        with pytest.raises(TypeError):
            mapping["panda_link1"] = 1.0
    with pytest.raises(AttributeError):
        model.gravity = np.zeros(3)
    model.neutral[:] = 7.0  # each access makes a new array
    assert (model.neutral != 7.0).all()


def test_arguments_are_copied():
    gravity = np.array([0.0, 0.0, -9.81])
    com = np.array([0.1, 0.0, 0.0])
    inertia = np.eye(3)
    payloads = {"panda_hand": (1.0, com, inertia)}
    locked = {"panda_joint1": 0.1}
    armature = {"panda_joint2": 0.1}
    model = load(gravity=gravity, payloads=payloads, locked_joints=locked, armature=armature)
    other = (
        model.with_gravity(gravity)
        .with_payload("panda_link2", 1.0, com, inertia)
        .with_locked_joints(locked)
    )
    before = fields(model), fields(other)
    for array in (gravity, com, inertia):
        array[:] = 0.5
    for mapping in (payloads, locked, armature):
        mapping.clear()
    assert (fields(model), fields(other)) == before


@pytest.mark.parametrize("way", COPIES)
def test_copies_have_the_same_bits(with_all, way):
    twin = COPIES[way](with_all)
    assert_same(twin, with_all)
    for change in CHANGES.values():
        assert fields(change(twin)) == fields(change(with_all))


# --- Changes and their reversal


def test_removed_payload_leaves_no_rounding(with_all):
    loaded = with_all.with_payload("panda_link5", 3.0, (0.1, 0.2, 0.3)).with_payload(
        "panda_link5", 1e6
    )
    assert_same(loaded.without_payload("panda_link5"), with_all)


def test_changes_commute(panda):
    """In any order they equal the options of the loader; later locks replace earlier ones."""
    gravity = (0.0, 3.0, 0.0)
    locks = {"panda_joint2": 0.3, "panda_joint4": -1.0}
    payload = tuple(PAYLOAD.values())
    at_once = load(gravity=gravity, locked_joints=locks, payloads={"panda_hand": payload})
    changes = (
        lambda model: model.with_gravity(gravity),
        lambda model: model.with_locked_joints({"panda_joint6": 1.0}).with_locked_joints(
            dict(reversed(locks.items()))
        ),
        lambda model: model.with_payload("panda_hand", **PAYLOAD),
    )
    for order in itertools.permutations(changes):
        model = panda
        for change in order:
            model = change(model)
        assert_same(model, at_once)
    assert_same(panda.with_locked_joints(locks).with_locked_joints({}), panda)


# --- Payloads, locks and copies


HELD = robots.description(
    "held",
    robots.link("base"),
    robots.link("arm", mass=1.0, com=(0.1, 0, 0), inertia=(0.1, 0, 0, 0.1, 0, 0.1)),
    robots.link("tip"),
    robots.joint("swing", "revolute", "base", "arm"),
    robots.joint("twist", "revolute", "arm", "tip", axis=(0, 1, 0)),
)


def test_joints_locked_as_massless_stay_locked():
    """A payload does not release them; `with_locked_joints` decides again."""
    stiff = dd.load_urdf(HELD, massless="lock")
    loaded = stiff.with_payload("tip", 1.0, (0.1, 0, 0))
    for model in (
        stiff,
        loaded,
        *(make(loaded) for make in COPIES.values()),
        loaded.without_payload("tip"),
    ):
        assert model.dof_names == ("swing",) and dict(model.locked_joints) == {"twist": 0.0}
    assert loaded.with_locked_joints({}).dof_names == ("swing", "twist")


def test_rounding_of_a_rotated_inertia_is_no_asymmetry():
    model = dd.load_urdf(HELD, massless="lock")
    rng = np.random.default_rng(1)
    for _ in range(20):
        rotation, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        inertia = (
            model.with_payload("tip", 1.0, inertia=rotation @ (0.1 * np.eye(3)) @ rotation.T)
            .payloads["tip"]
            .inertia
        )
        np.testing.assert_array_equal(inertia, inertia.T)


@pytest.mark.parametrize("way", COPIES)
def test_copies_of_dynamics_have_their_own_memory(panda, way):
    """A workspace lies at an address that a copy may not share."""
    dyn = dd.DiagonalDynamics(panda)
    q = np.full(dyn.model.nq, 0.1)
    qd = np.ones(dyn.model.nv)
    expected = dyn.evaluate(q, qd).coriolis
    twin = COPIES[way](dyn)
    del dyn
    gc.collect()
    np.testing.assert_array_equal(twin.evaluate(q, qd).coriolis, expected)


def test_pickled_models_are_equal_in_all_processes():
    """Another seed of hashes, which orders sets, does not change the bytes."""
    program = "import pickle, diag_dynamics; print(pickle.dumps(diag_dynamics.load_robot('ur5')))"
    texts = {
        subprocess.check_output(
            [sys.executable, "-c", program], env=os.environ | {"PYTHONHASHSEED": str(seed)}
        )
        for seed in range(2)
    }
    assert len(texts) == 1
