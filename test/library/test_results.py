# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Results: read-only and permanent, or written again where the caller passes `out`; batches as sequences and tables."""

import copy
import pickle
import tracemalloc

import numpy as np
import pytest

import diag_dynamics as dd
from diag_dynamics.results import NAMES
from robots import TwoLinkArm

COUNT = 20
"""States of a batch."""

MODELS = {
    "panda": lambda: dd.load_robot("panda"),
    "go2, floating": lambda: dd.load_robot("go2", floating_base=True),
}

COPIES = {
    "copy": copy.copy,
    "deepcopy": copy.deepcopy,
    "pickle": lambda value: pickle.loads(pickle.dumps(value)),
}


@pytest.fixture(scope="module", params=MODELS)
def dyn(request):
    return dd.DiagonalDynamics(MODELS[request.param]())


def state(dyn, seed=0):
    return dyn.model.neutral, *np.random.default_rng(seed).standard_normal((2, dyn.model.nv))


def states(dyn, count=COUNT):
    return [
        np.array(column)
        for column in zip(*(state(dyn, seed) for seed in range(count)), strict=True)
    ]


def every_kind(dyn):
    """Return one result of each kind."""
    more = {"f_ext": {dyn.model.link_names[-1]: np.ones(6)}, "friction": True}
    q, qd, tau = state(dyn)
    return {
        "new": dyn.evaluate(q, qd, tau),
        "new, with all": dyn.evaluate(q, qd, tau, **more),
        "reused": dyn.evaluate(q, qd, tau, out=dyn.new_evaluation()),
        "reused, with all": dyn.evaluate(q, qd, tau, out=dyn.new_evaluation(), **more),
        "batch": dyn.evaluate_batch(*states(dyn), **more),
        "reused batch": dyn.evaluate_batch(*states(dyn), out=dyn.new_batch(COUNT)),
    }


def assert_equal(one, other):
    for name, value in other.to_dict().items():
        np.testing.assert_array_equal(getattr(one, name), value, err_msg=name)


# --- Read-only values


def test_results_are_read_only(dyn):
    for kind, result in every_kind(dyn).items():
        for name in NAMES:
            with pytest.raises(AttributeError):
                setattr(result, name, 1.0)
            value = getattr(result, name)
            if isinstance(value, np.ndarray):
                assert not value.flags.writeable, (kind, name)
        with pytest.raises(AttributeError):
            result.something_new = 1.0
        assert all(f"{name}=" in repr(result) for name in result.to_dict())
    factors = dyn.factors(dyn.model.neutral)
    assert not any(array.flags.writeable for array in factors)
    assert factors.to_dict()["unit"] is factors.unit


@pytest.mark.parametrize("way", COPIES)
def test_copies_are_permanent(dyn, way):
    for result in every_kind(dyn).values():
        twin = COPIES[way](result)
        assert type(twin) is type(result) and not twin.nu.flags.writeable
        assert_equal(twin, result)
    q, qd, tau = state(dyn)
    with pytest.raises(dd.InputError, match=r"^out "):
        dyn.evaluate(q, qd, tau, out=copy.copy(dyn.evaluate(q, qd, tau, out=dyn.new_evaluation())))
    with pytest.raises(dd.InputError, match=r"^out "):
        dyn.evaluate_batch(
            *states(dyn), out=copy.copy(dyn.evaluate_batch(*states(dyn), out=dyn.new_batch(COUNT)))
        )


def test_rates_are_those_of_forward_dynamics(dyn):
    """ν̇ is the rate of mᵀq̇ along forward dynamics, with wrenches and friction."""
    q, qd, tau = state(dyn)
    wrench = {dyn.model.link_names[-1]: np.arange(1.0, 7.0)}
    qdd = dyn.forward_dynamics(q, qd, tau, wrench, friction=True)
    expected = dyn.nu_from_qd(q, qdd) + dyn.m_rate_transposed(q, qd, qd)
    found = dyn.evaluate(q, qd, tau, wrench, friction=True).nu_dot
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)


def test_stored_terms_are_those_of_the_equations(dyn):
    for kind, result in every_kind(dyn).items():
        s = result[0] if "batch" in kind else result
        rate = s.epsilon - s.coriolis - s.gravity
        if s.external is not None:
            rate = rate + s.external - s.friction
        moments = np.sqrt(s.articulated_inertia) * (rate + s.coriolis) - s.coriolis_unnormalized
        base = s.energy_share[:6].sum() if dyn.model.floating_base else 0.0
        np.testing.assert_allclose(s.nu_dot, rate, rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(
            s.xi_dot, moments / s.articulated_inertia, rtol=1e-12, atol=1e-12
        )
        np.testing.assert_allclose(s.power, s.nu @ (rate + s.coriolis), rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(
            s.effort_power, s.nu @ (s.epsilon - s.gravity), rtol=1e-9, atol=1e-9
        )
        np.testing.assert_allclose(s.base_energy, base)


# --- Results that are written again


def test_out_equals_a_new_result(dyn):
    """It does not depend on the previous content, and has NaN after an error."""
    out, batch = dyn.new_evaluation(), dyn.new_batch(COUNT)
    assert np.isnan(out.nu).all() and np.isnan(out.kinetic_energy) and np.isnan(batch.nu).all()
    q, qd, tau = state(dyn)
    wrench = {dyn.model.link_names[-1]: np.ones(6)}
    for arguments in (
        (q, qd, tau),
        (q, qd),
        (q, qd, tau, wrench),
        (q.tolist(), qd, tau),
        (q, -qd, tau),
    ):
        assert dyn.evaluate(*arguments, out=out) is out
        assert_equal(out, dyn.evaluate(*arguments))
    Q, QD, TAU = states(dyn)
    for arguments in ((Q, QD, TAU), (Q, QD), (Q, 2.0 * QD, TAU)):
        assert dyn.evaluate_batch(*arguments, out=batch) is batch
        assert_equal(batch, dyn.evaluate_batch(*arguments))
    dyn.evaluate(q, qd, tau, wrench, friction=True, out=out)
    dyn.evaluate_batch(Q, QD, TAU, wrench, friction=True, out=batch)
    qd[0] = QD[2, 0] = np.inf
    for call in (
        lambda: dyn.evaluate(q, qd, tau, out=out),
        lambda: dyn.evaluate_batch(Q, QD, TAU, out=batch),
    ):
        with pytest.raises(dd.InputError, match="is inf"):
            call()
    for result in (out, batch):
        assert np.isnan(result.nu).all() and np.isnan(result.kinetic_energy).all()
        assert result.external is None and result.friction is None
    qd[0] = 1.0
    other = dd.DiagonalDynamics(dyn.model)
    assert_equal(other.evaluate(q, qd, tau, out=out), dyn.evaluate(q, qd, tau))


def test_arrays_of_out_show_the_new_values(dyn):
    """Arrays of another `out`, of a new result and of a copy do not change."""
    q, qd, tau = state(dyn)
    out, new = dyn.new_evaluation(), dyn.evaluate(q, qd, tau)
    nu, before = dyn.evaluate(q, qd, tau, out=out).nu, new.nu.copy()
    other, copied = dyn.evaluate(q, qd, tau, out=dyn.new_evaluation()), copy.copy(out)
    dyn.evaluate(q, 2.0 * qd, tau, out=out)
    assert np.shares_memory(nu, out.nu)
    np.testing.assert_allclose(nu, 2.0 * before)
    for result in (other, copied, new):
        np.testing.assert_array_equal(result.nu, before)


TWO = dd.DiagonalDynamics(dd.load_urdf(TwoLinkArm().urdf))


def on_the_moon(dyn):
    return dd.DiagonalDynamics(dyn.model.with_gravity((0.0, 0.0, -1.62)))


WRONG_OUT = {
    "another robot": (lambda d, x: d.evaluate(*x, out=TWO.new_evaluation()), "'two_link_arm'"),
    "another model": (
        lambda d, x: d.evaluate(*x, out=on_the_moon(d).new_evaluation()),
        "another model",
    ),
    "a permanent result": (lambda d, x: d.evaluate(*x, out=d.evaluate(*x)), "out "),
    "no batch": (
        lambda d, x: d.evaluate_batch(*np.array([x]).swapaxes(0, 1), out=d.new_evaluation()),
        "new_batch",
    ),
    "of four": (
        lambda d, x: d.evaluate_batch(*np.array([x]).swapaxes(0, 1), out=d.new_batch(4)),
        "4 states",
    ),
    "of none": (lambda d, x: d.new_batch(-1), "count is -1"),
}


@pytest.mark.parametrize("case", WRONG_OUT)
def test_wrong_out(case):
    call, key = WRONG_OUT[case]
    dyn = dd.DiagonalDynamics(dd.load_robot("ur5"))
    with pytest.raises(dd.InputError) as caught:
        call(dyn, np.zeros((2, 6)))
    assert key in str(caught.value)


def test_results_are_arguments_of_the_call_that_overwrites_them(dyn):
    """Kernels read an argument completely before they write `out`."""
    (q, qd, tau), (Q, QD, TAU), tip = state(dyn), states(dyn), dyn.model.link_names[-1]
    of_one = {
        "rates": lambda s: (q, s.nu, tau),
        "wrenches": lambda s: (q, qd, tau, {tip: s.kappa[:6]}),
        "all": lambda s: (s.rows[-2, : dyn.model.nq], s.nu, s.kappa),
    }
    for arguments in of_one.values():
        out, apart = dyn.evaluate(q, qd, tau, out=dyn.new_evaluation()), dyn.evaluate(q, qd, tau)
        expected = dyn.evaluate(*arguments(apart), friction=True)
        assert_equal(dyn.evaluate(*arguments(out), friction=True, out=out), expected)
    of_many = {
        "rates and efforts": lambda b: (Q, b.nu, b.kappa),
        "rates in reverse": lambda b: (Q, b.xi[::-1]),
        "wrenches": lambda b: (Q, QD, TAU, {tip: b.kappa[:, :6]}),
    }
    for arguments in of_many.values():
        out, apart = (
            dyn.evaluate_batch(Q, QD, TAU, out=dyn.new_batch(COUNT)),
            dyn.evaluate_batch(Q, QD, TAU),
        )
        expected = dyn.evaluate_batch(*arguments(apart), friction=True)
        assert_equal(dyn.evaluate_batch(*arguments(out), friction=True, out=out), expected)


def test_loops_with_out_allocate_nothing():
    """The traced memory does not grow with the number of calls."""
    (q, qd, tau), (Q, QD, TAU) = state(TWO), states(TWO, 2000)
    out, batch = TWO.new_evaluation(), TWO.new_batch(2000)
    for count in (10, 1000):  # the first calls make a workspace
        tracemalloc.start()
        for _ in range(count):
            TWO.evaluate(q, qd, tau, out=out)
        single = tracemalloc.get_traced_memory()[1]
        tracemalloc.reset_peak()
        for _ in range(count // 10):
            TWO.evaluate_batch(Q, QD, TAU, threads=1, out=batch)
        many = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    assert single < 2000
    assert many < 20_000  # of 400 kB that a batch takes


# --- Batches as sequences and tables


def test_indices_and_slices(dyn):
    batch = every_kind(dyn)["batch"]
    for t in (0, 5, -1):
        one = batch[t]
        assert type(one) is dd.Evaluation and not one.nu.flags.writeable
        for name in NAMES:
            np.testing.assert_allclose(
                getattr(one, name), getattr(batch, name)[t], rtol=1e-12, atol=1e-300
            )
    for index in (slice(10, 19, 3), slice(3), slice(3, 3)):
        part = batch[index]
        assert type(part) is dd.BatchEvaluation and len(part) == len(range(COUNT)[index])
        assert not part.nu.flags.writeable
        for name in NAMES:
            np.testing.assert_array_equal(getattr(part, name), getattr(batch, name)[index])
    assert [one.kinetic_energy for one in batch] == list(batch.kinetic_energy)
    with pytest.raises(IndexError, match=f"batch of {COUNT}"):
        batch[COUNT]
    with pytest.raises(dd.InputError, match="'nu'"):
        batch["nu"]


def test_slice_of_a_reused_batch_is_permanent(dyn):
    Q, QD, TAU = states(dyn)
    out = dyn.evaluate_batch(Q, QD, TAU, out=dyn.new_batch(COUNT))
    part, expected = out[:7], dyn.evaluate_batch(Q[:7], QD[:7], TAU[:7])
    dyn.evaluate_batch(Q[::-1], 2 * QD, TAU, out=out)
    np.testing.assert_allclose(part.nu, expected.nu, rtol=1e-12, atol=1e-300)


def test_frames(dyn):
    import pandas

    batch = every_kind(dyn)["batch"]
    frame, table = batch[0].to_frame(), batch.to_frame()
    assert list(frame.index) == list(dyn.model.dof_names) and "external" in frame
    np.testing.assert_array_equal(frame["nu"], batch.nu[0])
    assert isinstance(table, pandas.DataFrame) and len(table) == COUNT
    np.testing.assert_array_equal(table["nu", dyn.model.dof_names[-1]], batch.nu[:, -1])
    np.testing.assert_array_equal(table["kinetic_energy", ""], batch.kinetic_energy)
    np.testing.assert_array_equal(table["link_energy"], batch.link_energy)
    assert "epsilon" not in dyn.evaluate(*state(dyn)[:2]).to_frame()


def test_robot_without_joints():
    dyn = dd.DiagonalDynamics(dd.load_urdf('<robot name="still"><link name="base"/></robot>'))
    for result in (dyn.evaluate([], [], []), dyn.evaluate([], [], out=dyn.new_evaluation())):
        assert (
            result.kinetic_energy == 0.0
            and result.nu.shape == (0,)
            and result.link_energy.tolist() == [0.0]
        )
    many = dyn.evaluate_batch(np.zeros((3, 0)), np.zeros((3, 0)))
    assert many.kinetic_energy.tolist() == [0.0] * 3 and many.nu.shape == (3, 0)
    assert dyn.factors([]).m.shape == dyn.mass_matrix([]).shape == (0, 0)
    assert dyn.forward_dynamics([], [], []).shape == (0,)
