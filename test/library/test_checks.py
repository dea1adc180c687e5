# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Arguments: numbers of any kind, vectors by position or by the names of joints, and errors that
name what is wrong.
"""

import inspect
from contextlib import nullcontext

import numpy as np
import pytest

import diag_dynamics as dd
from diag_dynamics import checks
from diag_dynamics.dynamics import dynamics
from diag_dynamics.sweeps import evaluation
from robots import description, joint, link

NAMES = ("shoulder", "elbow")

# --- The checks


@pytest.mark.parametrize(
    "value", [None, "1", b"1", True, [1.0, "2"], [[1.0], [2.0, 3.0]], {}, 1j, object], ids=repr
)
def test_values_that_are_no_numbers(value):
    assert checks.array_of(value) is None
    for check in (
        lambda: checks.number("x", value, "a number"),
        lambda: checks.numbers("x", value, (2,), "two numbers"),
        lambda: checks.vector("x", value, NAMES),
        lambda: checks.per_name("x", value, NAMES),
    ):
        with pytest.raises(dd.InputError, match=r"^x "):
            check()


@pytest.mark.parametrize("value", [2, 2.0, np.float32(2.0), np.int64(2), np.array(2.0)], ids=repr)
def test_number_of_any_kind_is_a_float(value):
    for x in (checks.number("x", value, "a number"), checks.positive("x", value, "[s]")):
        assert type(x) is float and x == 2.0
    assert checks.per_name("x", value, NAMES).tolist() == [2.0, 2.0]


@pytest.mark.parametrize(
    ("check", "key"),
    [
        (
            lambda: checks.positive("x", 0.0, "[1/s]"),
            "x is 0.0; expected a finite number > 0 [1/s]",
        ),
        (lambda: checks.not_negative("x", -1, "[s]"), "x is -1; expected a finite number >= 0 [s]"),
        (lambda: checks.number("x", "0", "a number"), "x is '0'; expected a number"),
        (lambda: checks.choice("x", "c", ("a", "b")), "x is 'c'; expected one of 'a', 'b'"),
        (lambda: checks.whole("x", True), "x is True; expected a whole number >= 1"),
        (
            lambda: checks.numbers("x", [1, -9], (2,), "two", 5.0),
            "x is [1, -9]; expected two, none beyond ±5",
        ),
        (lambda: checks.per_name("x", [1, -2], NAMES), "x of 'elbow' is -2.0"),
        (
            lambda: checks.per_name("x", [1, 2, 3], NAMES),
            "x is [1, 2, 3]; expected a finite number > 0, or 2 such",
        ),
    ],
)
def test_error_names_value_and_bounds(check, key):
    with pytest.raises(dd.InputError) as caught:
        check()
    assert str(caught.value).startswith(key)


def test_checked_values_are_copies():
    value = np.array([1.0, 2.0])
    copies = [checks.numbers("x", value, (2,), "two"), checks.vector("x", value, NAMES)]
    copies.append(checks.per_name("x", value, NAMES))
    assert not any(np.shares_memory(value, copy) for copy in copies)
    assert not copies[2].flags.writeable


# --- Arguments of DiagonalDynamics


@pytest.fixture(scope="module")
def two():
    body = (2.0, (0.1, 0.2, 0.3), (0.1, 0.0, 0.0, 0.2, 0.0, 0.25))
    links = (link("base"), link("upper", *body), link("lower", *body))
    joints = (
        joint("shoulder", "revolute", "base", "upper"),
        joint("elbow", "prismatic", "upper", "lower"),
    )
    return dd.DiagonalDynamics(dd.load_urdf(description("arm", *links, *joints)))


Z, NAN, LARGE = [0, 0], [0, np.nan], [1e200, 0]

WRONG = [
    (
        lambda d: d.evaluate([0.0], Z),
        "q has shape (1,); expected (2,): one entry for each of shoulder",
    ),
    (lambda d: d.evaluate([np.inf, 0], Z), "q of joint 'shoulder' is inf"),
    (lambda d: d.evaluate(Z, Z, [0, -np.inf]), "tau of joint 'elbow' is -inf"),
    (lambda d: d.evaluate(Z, LARGE), "too large"),
    # the power
    (
        lambda d: d.evaluate(Z, [1e150, 0], Z, f_ext={"upper": [0, 1e200, 0, 0, 0, 1e200]}),
        "power overflows",
    ),
    (lambda d: d.evaluate(Z, Z, f_ext={"lower": [1.7e308] * 6}), "f_ext is too large"),
    (lambda d: d.operational_inverse_inertia(Z, "lower", [1e200, 0, 0]), "is too far away"),
    (lambda d: d.evaluate(np.zeros(2), np.zeros(2), frame="tool"), "frame is 'tool'"),
    (lambda d: d.forward_dynamics(*np.zeros((3, 2)), frame="tool"), "frame is 'tool'"),
    (lambda d: d.inverse_dynamics(Z, Z, Z, frame="tool"), "frame is 'tool'"),
    (lambda d: d.evaluate(Z, Z, f_ext={"hand": [0] * 6}), "f_ext is 'hand'"),
    (lambda d: d.evaluate(Z, Z, f_ext=np.zeros(6)), "expected a dict by name"),
    (lambda d: d.forward_dynamics(Z, LARGE, Z), "too large"),
    (lambda d: d.forward_dynamics(Z, Z, NAN), "tau of joint 'elbow' is nan"),
    (lambda d: d.potential_energy(NAN), "q of joint 'elbow' is nan"),
    (lambda d: d.regressor(Z, Z, NAN), "qdd of joint 'elbow' is nan"),
    (lambda d: d.epsilon_from_tau(Z, NAN), "tau of joint 'elbow' is nan"),
    (lambda d: d.tau_from_epsilon(Z, [Z]), "epsilon has shape (1, 2)"),
    (lambda d: dd.DiagonalDynamics("arm.urdf"), "RobotModel"),
    # by name
    (lambda d: d.mass_matrix({"shoulder": 0.0}), "q lacks elbow"),
    (
        lambda d: d.mass_matrix({"shoulder": 0.0, "elbow": 0.0, "elbwo": 0.0}),
        "they are shoulder, elbow",
    ),
    (
        lambda d: d.evaluate({"shoulder": Z, "elbow": [0]}, [Z, Z]),
        "q has columns of several lengths",
    ),
    # masked entries
    (lambda d: d.mass_matrix(masked(Z)), "q has 1 masked entries"),
    (lambda d: d.evaluate(masked([Z]), [Z]), "q has 1 masked entries"),
]


def masked(values):
    return np.ma.masked_array(
        np.array(values, float), mask=np.broadcast_to([False, True], np.shape(values))
    )


@pytest.mark.parametrize(("call", "key"), WRONG)
def test_wrong_arguments(two, call, key):
    with pytest.raises(dd.InputError) as caught:
        call(two)
    assert key in str(caught.value)
    assert two.evaluate([0.1, 0.2], [0.3, 0.4]).kinetic_energy > 0.0


def test_robot_without_mass_has_no_centre():
    moved = joint("j", "revolute", "a", "b")
    model = dd.load_urdf(description("r", link("a"), link("b"), moved), armature={"j": 0.1})
    with pytest.raises(dd.InputError, match="total_mass of robot 'r' is 0"):
        dd.DiagonalDynamics(model).center_of_mass([0.0])


def test_methods_of_a_link_have_one_order_of_arguments():
    """q, link, others, point, frame, then keywords alone."""
    methods = inspect.getmembers(dd.DiagonalDynamics, inspect.isfunction)
    orders = {name: list(inspect.signature(method).parameters.values()) for name, method in methods}
    named = {
        name: [x.name for x in order if x.kind is not x.KEYWORD_ONLY]
        for name, order in orders.items()
        if name[0] != "_" and "link" in [x.name for x in order]
    }
    assert len(named) == 10
    assert all(names[1:3] == ["q", "link"] for names in named.values())
    assert named.pop("placement") == ["self", "q", "link"]
    assert all(names[-2:] == ["point", "frame"] for names in named.values()), named


def test_methods_are_compiled_by_calls_of_one_state(two, monkeypatch):
    """All methods accept the arguments that compile has for them, as no error is suppressed."""
    called = []
    monkeypatch.setattr(
        type(two), "mass_matrix", lambda self, q, *, threads=None: called.append(q.tolist())
    )
    two.compile("mass_matrix")
    assert called == [[0.0, 0.0]]
    monkeypatch.setattr(dynamics, "suppress", lambda *errors: nullcontext())
    two.compile()
    assert evaluation.link_energies.run != evaluation.link_energies._compile_and_run
    with pytest.raises(dd.InputError, match="method is 'evaluation'; expected one of 'evaluate'"):
        two.compile("evaluation")


def test_vectors_of_any_kind(two):
    q = np.array([0.1, 0.2])
    qd = np.array([0.3, 0.4])
    expected = two.evaluate(q, qd).nu
    read_only = q.copy()
    read_only.flags.writeable = False
    strided = np.array([0.1, 9.0, 0.2, 9.0])[::2]
    unmasked = np.ma.masked_array(q, mask=False)
    unaligned = np.zeros(1, np.dtype([("flag", "u1"), ("q", "<f8", (2,))]))[0]["q"]
    unaligned[:] = q
    for other in ([0.1, 0.2], (0.1, 0.2), strided, read_only, unmasked, unaligned, q.astype(">f8")):
        np.testing.assert_array_equal(two.evaluate(other, qd).nu, expected)
    np.testing.assert_allclose(two.evaluate(q.astype(np.float32), qd).nu, expected, rtol=1e-6)


# --- Vectors by the names of joints


@pytest.fixture(scope="module")
def dyn():
    return dd.DiagonalDynamics(dd.load_robot("panda"))


@pytest.fixture
def state(dyn):
    rng = np.random.default_rng(2)
    return dyn.model.random(rng), rng.normal(size=dyn.model.nv), rng.normal(size=dyn.model.nv)


def by_name(dyn, vector):
    """Return a vector as a dict in another order."""
    return dict(reversed(list(zip(dyn.model.dof_names, vector, strict=True))))


def test_dicts(dyn, state):
    named = [by_name(dyn, x) for x in state]
    expected = dyn.evaluate(*state)
    result = dyn.evaluate(*named)
    np.testing.assert_array_equal(result.nu, expected.nu)
    np.testing.assert_array_equal(result.epsilon, expected.epsilon)
    np.testing.assert_array_equal(dyn.model.integrate(*named[:2]), dyn.model.integrate(*state[:2]))
    Q, QD = (np.stack([x, 2 * x]) for x in state[:2])
    columns = dict(zip(reversed(dyn.model.dof_names), Q.T[::-1], strict=True))
    expected = dyn.evaluate(Q, QD).nu
    np.testing.assert_array_equal(dyn.evaluate(columns, QD).nu, expected)
    rows = dyn.evaluate([named[0]] * 2, [named[1]] * 2).nu
    np.testing.assert_allclose(rows, [dyn.nu_from_qd(*state[:2])] * 2, rtol=1e-12, atol=1e-14)


def test_series_and_frames(dyn, state):
    """Series without names are in the order of the joints."""
    import pandas

    names = dyn.model.dof_names
    order = np.random.default_rng(0).permutation(dyn.model.nv)
    q, qd, tau = (pandas.Series(x, names).iloc[order] for x in state)
    expected = dyn.evaluate(*state)
    np.testing.assert_array_equal(dyn.evaluate(q, qd, tau).nu, expected.nu)
    np.testing.assert_array_equal(dyn.evaluate(*map(pandas.Series, state)).nu, expected.nu)
    positions = pandas.DataFrame([state[0]] * 3, columns=names).iloc[:, order]
    rates = pandas.DataFrame([state[1]] * 3, columns=names)
    np.testing.assert_array_equal(dyn.evaluate(positions, rates).nu, [expected.nu] * 3)
    with pytest.raises(dd.InputError, match="q has 'panda_joint1' twice"):
        dyn.mass_matrix(pandas.Series(np.zeros(dyn.model.nv), [names[0]] * dyn.model.nv))
