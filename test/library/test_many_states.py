# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""One quantity of many states: each row is what the single call gives; and batches as sequences and tables."""

import copy
import pickle

import numpy as np
import pytest

import diag_dynamics as dd
from robots import random_tree, robot

T = 600  # more than one piece for each of two threads


@pytest.fixture(
    scope="module",
    params=["panda", "floating", "mobile"],
)
def case(request):
    model = {
        "panda": lambda: dd.load_robot("panda"),
        "floating": lambda: dd.load_urdf(robot("ur_description/urdf/ur5_robot.urdf").urdf, floating_base=True),
        "mobile": lambda: dd.load_urdf(random_tree(20, kinds=("revolute", "prismatic", "planar"))),
    }[request.param]()
    rng = np.random.default_rng(7)
    Q = np.stack([model.random(rng) for _ in range(T)])
    return dd.DiagonalDynamics(model), Q, *rng.normal(size=(3, T, model.nv))


def rows(function, *arguments):
    return np.stack([function(*(x[t] for x in arguments)) for t in range(T)])


def test_classical(case):
    """M, c, g, forward and inverse dynamics have the bits of single calls, on any number of threads."""
    dyn, Q, QD, TAU, QDD = case
    for threads in (1, 2, None):
        assert (dyn.mass_matrix_batch(Q, threads=threads) == rows(dyn.mass_matrix, Q)).all()
        assert (dyn.bias_batch(Q, QD, threads=threads) == rows(dyn.bias, Q, QD)).all()
        assert (dyn.gravity_torque_batch(Q, threads=threads) == rows(dyn.gravity_torque, Q)).all()
        assert (dyn.forward_dynamics_batch(Q, QD, TAU, threads=threads) == rows(dyn.forward_dynamics, Q, QD, TAU)).all()
        assert (dyn.inverse_dynamics_batch(Q, QD, QDD, threads=threads) == rows(dyn.inverse_dynamics, Q, QD, QDD)).all()


def test_sweeps(case):
    dyn, Q, X, _, _ = case
    for name in ("nu_from_qd", "qd_from_nu", "epsilon_from_tau", "tau_from_epsilon"):
        assert (getattr(dyn, f"{name}_batch")(Q, X) == rows(getattr(dyn, name), Q, X)).all()
    assert (dyn.friction_torque_batch(X) == rows(dyn.friction_torque, X)).all()


@pytest.mark.parametrize("frame", ["link", "world"])
def test_friction_and_wrenches(case, frame):
    """The same wrench at all states, and one for each; friction; in everything that takes them."""
    dyn, Q, QD, TAU, QDD = case
    first, last = dyn.model.link_names[0], dyn.model.link_names[-1]
    rng = np.random.default_rng(3)
    constant, each = rng.normal(size=6), rng.normal(size=(T, 6))
    f_ext = {first: constant, last: each}
    options = {"frame": frame, "friction": True}
    forward = dyn.forward_dynamics_batch(Q, QD, TAU, f_ext, **options)
    inverse = dyn.inverse_dynamics_batch(Q, QD, QDD, f_ext, **options)
    batch = dyn.evaluate_batch(Q, QD, TAU, f_ext, **options)
    for t in range(0, T, 97):
        single = {first: constant, last: each[t]}
        np.testing.assert_allclose(forward[t], dyn.forward_dynamics(Q[t], QD[t], TAU[t], single, **options), rtol=1e-11)
        np.testing.assert_allclose(inverse[t], dyn.inverse_dynamics(Q[t], QD[t], QDD[t], single, **options), rtol=1e-11)
        one = dyn.evaluate(Q[t], QD[t], TAU[t], single, **options)
        for name in ("external", "friction", "nu_dot", "xi_dot", "power"):
            np.testing.assert_allclose(getattr(batch, name)[t], getattr(one, name), rtol=1e-9, atol=1e-9)


def test_the_first_state_that_fails_is_named(case):
    dyn, Q, QD, TAU, QDD = case
    wrong = QD.copy()
    wrong[[411, 17], 0] = np.nan
    for call in (
        lambda: dyn.forward_dynamics_batch(Q, wrong, TAU),
        lambda: dyn.inverse_dynamics_batch(Q, wrong, QDD),
        lambda: dyn.bias_batch(Q, wrong),
        lambda: dyn.friction_torque_batch(wrong),
    ):
        with pytest.raises(dd.InputError, match=r"state 17: qd of joint .* is nan"):
            call()
    with pytest.raises(dd.InputError, match=rf"TAU has shape .* expected \({T}, {dyn.model.nv}\)"):
        dyn.forward_dynamics_batch(Q, QD, TAU[1:])
    with pytest.raises(dd.InputError, match="threads is 0"):
        dyn.bias_batch(Q, QD, threads=0)
    with pytest.raises(dd.InputError, match="'nowhere' is not a link"):
        dyn.forward_dynamics_batch(Q, QD, TAU, {"nowhere": np.zeros(6)})
    with pytest.raises(dd.InputError, match=rf"\({T}, 6\) of them"):
        dyn.evaluate_batch(Q, QD, TAU, {dyn.model.link_names[-1]: np.zeros((3, 6))})
    with pytest.raises(dd.InputError, match="state 2: efforts, f_ext or friction"):
        force = np.zeros((T, 6))
        force[2] = 1.7e308
        dyn.inverse_dynamics_batch(Q, QD, QDD, {dyn.model.link_names[-1]: force})


def test_no_states(case):
    dyn, Q, QD, TAU, _ = case
    assert dyn.forward_dynamics_batch(Q[:0], QD[:0], TAU[:0]).shape == (0, dyn.model.nv)
    assert dyn.mass_matrix_batch(Q[:0]).shape == (0, dyn.model.nv, dyn.model.nv)


# --- batches as sequences and tables

FIELDS = (
    *("nu", "xi", "epsilon", "kappa", "coriolis", "coriolis_unnormalized", "gravity", "articulated_inertia"),
    *("articulated_inertia_rate", "external", "friction", "nu_dot", "xi_dot", "kinetic_energy", "energy_share"),
    *("base_energy", "link_energy", "power", "effort_power"),
)


@pytest.fixture(scope="module")
def batch(case):
    dyn, Q, QD, TAU, _ = case
    return dyn.evaluate_batch(Q, QD, TAU, {dyn.model.link_names[-1]: np.ones(6)}, friction=True)


def test_indexing(case, batch):
    """A state of a batch is an Evaluation like that of a single call; a slice is a batch; copies and pickles hold all."""
    for t in (0, 5, -1):
        one = batch[t]
        assert type(one) is dd.Evaluation
        for name in FIELDS:
            np.testing.assert_allclose(getattr(one, name), getattr(batch, name)[t], rtol=1e-12, atol=1e-300)
    for part, index in ((batch[10:200:7], slice(10, 200, 7)), (batch[:3], slice(3)), (batch[3:3], slice(3, 3))):
        assert type(part) is dd.BatchEvaluation and len(part) == len(range(T)[index])
        for name in FIELDS:
            assert (getattr(part, name) == getattr(batch, name)[index]).all()
    for other in (copy.copy(batch), pickle.loads(pickle.dumps(batch))):
        assert all((getattr(other, name) == getattr(batch, name)).all() for name in FIELDS)
    assert [one.kinetic_energy for one in batch[:4]] == list(batch.kinetic_energy[:4])
    assert not batch[0].nu.flags.writeable and not batch[:2].nu.flags.writeable
    with pytest.raises(IndexError, match=f"state {T} of a batch of {T}"):
        batch[T]
    with pytest.raises(dd.InputError, match="'nu' is no index"):
        batch["nu"]


def test_frames(case, batch):
    """Tables have the names of joints and links, and all numbers."""
    pandas = pytest.importorskip("pandas", reason="pandas is not installed")
    dyn = case[0]
    frame = batch[0].to_frame()
    assert list(frame.index) == list(dyn.model.dof_names)
    assert (frame["nu"].to_numpy() == batch.nu[0]).all() and "external" in frame
    table = batch.to_frame()
    assert isinstance(table, pandas.DataFrame) and len(table) == T
    name = dyn.model.dof_names[-1]
    assert (table["nu", name].to_numpy() == batch.nu[:, -1]).all()
    assert (table["kinetic_energy", ""].to_numpy() == batch.kinetic_energy).all()
    assert (table["link_energy"].to_numpy() == batch.link_energy).all()
    assert "epsilon" not in dyn.evaluate(case[1][0], case[2][0]).to_frame()


def test_a_slice_of_a_reused_batch_stays(case):
    """It is of one batch, whole, whatever is evaluated into the memory of that afterwards."""
    dyn, Q, QD, TAU, _ = case
    out = dyn.new_batch(T)
    dyn.evaluate_batch(Q, QD, TAU, friction=True, out=out)
    part, expected = out[:7], dyn.evaluate_batch(Q[:7], QD[:7], TAU[:7], friction=True)
    dyn.evaluate_batch(Q[::-1], 2 * QD, TAU, friction=True, out=out)
    for name in FIELDS:
        if getattr(expected, name) is not None:
            np.testing.assert_allclose(getattr(part, name), getattr(expected, name), rtol=1e-12, atol=1e-300)
    assert not out.friction.flags.writeable


def test_wrenches_may_lie_in_out(case):
    """They are taken as they were before, of one state and of many."""
    dyn, Q, QD, TAU, _ = case
    last, out = dyn.model.link_names[-1], dyn.new_evaluation()
    dyn.evaluate(Q[0], QD[0], TAU[0], out=out)
    expected = dyn.evaluate(Q[1], QD[1], TAU[1], {last: out.kappa[:6].copy()}).external.copy()
    assert (dyn.evaluate(Q[1], QD[1], TAU[1], {last: out.kappa[:6]}, out=out).external == expected).all()
    batch = dyn.new_batch(T)
    dyn.evaluate_batch(Q, QD, TAU, out=batch)
    expected = dyn.evaluate_batch(Q, 2 * QD, TAU, {last: batch.kappa[:, :6].copy()}).external.copy()
    assert (dyn.evaluate_batch(Q, 2 * QD, TAU, {last: batch.kappa[:, :6]}, out=batch).external == expected).all()


def test_overflows_are_named(case):
    dyn, Q, QD, TAU, _ = case
    last, wrong = dyn.model.link_names[-1], TAU.copy()
    wrong[3, 1] = np.nan
    with pytest.raises(dd.InputError, match=r"state 3: tau of joint .* is nan"):
        dyn.forward_dynamics_batch(Q, QD, wrong, friction=True)
    with pytest.raises(dd.InputError, match=r"f_ext is too large|the power overflows"):
        dyn.evaluate_batch(Q, QD, TAU, {last: np.full(6, 1.7e308)})
