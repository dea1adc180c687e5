# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Results: plain and read-only, or written again and again where the caller asks for that."""

import copy
import pickle
import tracemalloc

import numpy as np
import pytest

import diag_dynamics as dd
from diag_dynamics.results import NAMES
from robots import TwoLinkArm, robot_path

ROBOTS = {
    "panda": ("panda_description/urdf/panda.urdf", {}),
    "go2, floating": ("go2_description/urdf/go2.urdf", {"floating_base": True}),
}


@pytest.fixture(scope="module", params=ROBOTS)
def dyn(request):
    path, options = ROBOTS[request.param]
    return dd.DiagonalDynamics(dd.load_urdf(robot_path(path), **options))


@pytest.fixture(scope="module")
def two():
    return dd.DiagonalDynamics(dd.load_urdf(TwoLinkArm().urdf))


def state(dyn, seed=0):
    return dyn.model.neutral, *np.random.default_rng(seed).standard_normal((2, dyn.model.nv))


def states(dyn, count, seed=0):
    rows = [state(dyn, seed + t) for t in range(count)]
    return [np.array(column) for column in zip(*rows, strict=True)]


def made(dyn):
    """Return one of every kind of result."""
    more = {"f_ext": {dyn.model.link_names[-1]: np.ones(6)}, "friction": True}
    q, qd, tau = state(dyn)
    return {
        "plain": dyn.evaluate(q, qd, tau),
        "everything": dyn.evaluate(q, qd, tau, **more),
        "reused": dyn.evaluate(q, qd, tau, out=dyn.new_evaluation()),
        "reused, everything": dyn.evaluate(q, qd, tau, out=dyn.new_evaluation(), **more),
        "batch": dyn.evaluate_batch(*states(dyn, 5), friction=True),
        "reused batch": dyn.evaluate_batch(*states(dyn, 5), out=dyn.new_batch(5)),
    }


def assert_equal(one, other):
    for name, value in other.to_dict().items():
        np.testing.assert_array_equal(getattr(one, name), value, err_msg=name)


def test_a_write_raises(dyn):
    for kind, s in made(dyn).items():
        for name in NAMES:
            with pytest.raises(AttributeError):
                setattr(s, name, 1.0)
            value = getattr(s, name)
            if isinstance(value, np.ndarray):
                with pytest.raises(ValueError, match="read-only"):
                    value[...] = 1.0
                assert not value.flags.writeable, (kind, name)
        with pytest.raises(AttributeError):
            s.something_new = 1.0


def test_repr_and_dict(dyn):
    for s in made(dyn).values():
        found = s.to_dict()
        assert tuple(found) == NAMES
        text = repr(s)
        assert text.startswith(f"{type(s).__name__}(")
        for name, value in found.items():
            assert f"{name}=" in text
            np.testing.assert_array_equal(value, getattr(s, name))
        if isinstance(s.kinetic_energy, float):
            assert f"kinetic_energy={s.kinetic_energy}," in text
    f = dyn.factors(dyn.model.neutral)
    assert f.to_dict()["unit"] is f.unit


def test_reused_is_the_same(dyn):
    """Whatever was in it before: with efforts and without, with wrenches, after an error."""
    out, batch = dyn.new_evaluation(), dyn.new_batch(4)
    assert np.isnan(out.nu).all() and np.isnan(out.kinetic_energy) and np.isnan(batch.nu).all()
    q, qd, tau = state(dyn)
    wrench = {dyn.model.link_names[-1]: np.ones(6)}
    for arguments in ((q, qd, tau), (q, qd), (q, qd, tau, wrench), (q.tolist(), qd, tau), (q, -qd, tau)):
        assert dyn.evaluate(*arguments, out=out) is out
        assert_equal(out, dyn.evaluate(*arguments))
    Q, QD, TAU = states(dyn, 4)
    for arguments in ((Q, QD, TAU), (Q, QD), (Q, -QD, TAU)):
        assert dyn.evaluate_batch(*arguments, out=batch) is batch
        assert_equal(batch, dyn.evaluate_batch(*arguments))
    with pytest.raises(dd.InputError, match="is nan"):
        dyn.evaluate(q, np.full_like(qd, np.nan), tau, out=out)
    assert np.isnan(out.nu).all() and np.isnan(out.kinetic_energy)
    dyn.evaluate(q, qd, tau, wrench, friction=True, out=out)
    with pytest.raises(dd.InputError, match="is nan"):
        dyn.evaluate(q, np.full_like(qd, np.nan), tau, out=out)
    assert out.external is None and out.friction is None
    QD[2, 0] = np.inf
    with pytest.raises(dd.InputError, match="state 2"):
        dyn.evaluate_batch(Q, QD, TAU, out=batch)
    assert np.isnan(batch.nu).all()
    dyn.evaluate(q, qd, tau, out=out)
    assert_equal(out, dyn.evaluate(q, qd, tau))


def test_arrays_read_before_show_the_new_results(dyn):
    """And never those of another `out`, of a plain result, or of a copy."""
    q, qd, tau = state(dyn)
    out, other, stays = dyn.new_evaluation(), dyn.new_evaluation(), dyn.evaluate(q, qd, tau)
    nu = dyn.evaluate(q, qd, tau, out=out).nu
    dyn.evaluate(q, qd, tau, out=other)
    kept, said = copy.copy(out), stays.to_dict()
    dyn.evaluate(q, 2.0 * qd, tau, out=out)
    assert np.shares_memory(nu, out.nu)
    np.testing.assert_allclose(nu, 2.0 * stays.nu)
    for s in (other, kept, stays):
        assert_equal(s, stays)
        np.testing.assert_array_equal(s.nu, said["nu"])
        assert not np.shares_memory(s.nu, nu)


@pytest.mark.parametrize("way", [copy.copy, copy.deepcopy, lambda s: pickle.loads(pickle.dumps(s))])
def test_copies_stay(dyn, way):
    for s in made(dyn).values():
        twin = way(s)
        assert type(twin) is type(s)
        assert_equal(twin, s)
        assert not twin.nu.flags.writeable
        with pytest.raises(dd.InputError, match="stays as it is"):
            evaluate = dyn.evaluate_batch if isinstance(s, dd.BatchEvaluation) else dyn.evaluate
            rows = states(dyn, 5) if isinstance(s, dd.BatchEvaluation) else state(dyn)
            evaluate(*rows, out=twin if twin._model is dyn.model else s.__reduce__()[0](*s.__reduce__()[1]))


def test_wrong_out_is_named(dyn, two):
    q, qd, _ = state(dyn)
    other = dd.DiagonalDynamics(dyn.model.with_gravity((0.0, 0.0, -1.62)))
    Q, QD, TAU = states(dyn, 3)
    calls = {
        "out is of robot 'two_link_arm' \\(2 dof\\), expected '": lambda: dyn.evaluate(q, qd, out=two.new_evaluation()),
        "\\(another model\\), expected": lambda: dyn.evaluate(q, qd, out=other.new_evaluation()),
        "stays as it is": lambda: dyn.evaluate(q, qd, out=dyn.evaluate(q, qd)),
        "out is of type ndarray": lambda: dyn.evaluate(q, qd, out=np.zeros((14, 9))),
        "expected what new_batch\\(T\\)": lambda: dyn.evaluate_batch(Q, QD, TAU, out=dyn.new_evaluation()),
        "out has room for 4 states, expected 3": lambda: dyn.evaluate_batch(Q, QD, TAU, out=dyn.new_batch(4)),
        "count is -1": lambda: dyn.new_batch(-1),
    }
    for message, call in calls.items():
        with pytest.raises(dd.InputError, match=message):
            call()


def test_another_dynamics_of_the_model_may_write(dyn):
    q, qd, tau = state(dyn)
    out = dyn.new_evaluation()
    assert_equal(dd.DiagonalDynamics(dyn.model).evaluate(q, qd, tau, out=out), dyn.evaluate(q, qd, tau))


def test_results_are_arguments(dyn):
    """Compiled code takes what is read-only as it takes anything else."""
    q, qd, tau = state(dyn)
    s = dyn.evaluate(q, qd, tau)
    np.testing.assert_array_equal(dyn.qd_from_nu(q, s.nu), dyn.qd_from_nu(q, s.nu.copy()))
    np.testing.assert_array_equal(dyn.evaluate(q, s.xi, s.kappa).nu, dyn.evaluate(q, s.xi.copy(), s.kappa.copy()).nu)
    Q, QD, TAU = states(dyn, 20)
    b = dyn.evaluate_batch(Q, QD, TAU)
    np.testing.assert_array_equal(dyn.evaluate_batch(Q, b.xi).nu, dyn.evaluate_batch(Q, b.xi.copy()).nu)


def test_results_are_arguments_of_what_overwrites_them(dyn):
    """Whichever argument, whole or in part, with what else there is to evaluate; in a batch, too."""
    q, qd, tau = state(dyn)
    wrench = {dyn.model.link_names[-1]: np.ones(6)}
    nq = dyn.model.nq
    of_state = {
        "rates": lambda s: (q, s.nu, tau),
        "efforts": lambda s: (q, qd, s.kappa),
        "positions": lambda s: (s.rows[-2, :nq], qd, tau),
        "all": lambda s: (s.rows[-2, :nq], s.nu, s.kappa, wrench),
    }
    for what, arguments in of_state.items():
        out, apart = dyn.evaluate(q, qd, tau, out=dyn.new_evaluation()), dyn.evaluate(q, qd, tau)
        expected = dyn.evaluate(*arguments(apart), friction=what == "all")
        assert_equal(dyn.evaluate(*arguments(out), friction=what == "all", out=out), expected)
    Q, QD, TAU = states(dyn, 20)
    for arguments in (lambda b: (Q, b.nu, TAU), lambda b: (Q, QD, b.kappa), lambda b: (Q, b.xi[::-1])):
        out, apart = dyn.evaluate_batch(Q, QD, TAU, out=dyn.new_batch(20)), dyn.evaluate_batch(Q, QD, TAU)
        expected = dyn.evaluate_batch(*arguments(apart), friction=True)
        assert_equal(dyn.evaluate_batch(*arguments(out), friction=True, out=out), expected)


def test_loops_allocate_nothing(two):
    """Not a byte is traced while one `out` is written, whatever the number of calls."""
    q, qd, tau = state(two)
    out, batch, (Q, QD, TAU) = two.new_evaluation(), two.new_batch(2000), states(two, 2000)
    for count in (10, 1000):  # the first calls make a workspace
        tracemalloc.start()
        for _ in range(count):
            two.evaluate(q, qd, tau, out=out)
        single = tracemalloc.get_traced_memory()[1]
        tracemalloc.reset_peak()
        for _ in range(count // 10):
            two.evaluate_batch(Q, QD, TAU, threads=1, out=batch)
        many = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    assert single < 2000
    assert many < 20_000  # of 400 kB that a batch takes


def test_robot_that_cannot_move():
    dyn = dd.DiagonalDynamics(dd.load_urdf('<robot name="still"><link name="base"/></robot>'))
    for s in (dyn.evaluate([], []), dyn.evaluate([], [], out=dyn.new_evaluation())):
        assert s.kinetic_energy == 0.0 and s.nu.shape == (0,)
    many = dyn.evaluate_batch(np.zeros((3, 0)), np.zeros((3, 0)))
    assert many.kinetic_energy.tolist() == [0.0] * 3 and many.nu.shape == (3, 0)


def test_factors_are_read_only():
    """As all results: a write raises, and the next call gives the same."""
    dyn = dd.DiagonalDynamics(dd.load_robot("ur5"))
    q = dyn.model.random(1)
    f = dyn.factors(q)
    for array in f:
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0
    assert all((a == b).all() for a, b in zip(f, dyn.factors(q.tolist()), strict=True))
