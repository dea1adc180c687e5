# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Many states at once: the numbers of single calls, whatever the number of threads, in bounded memory."""

import dataclasses
import os
import signal
import sys
import threading
import time
import traceback
import tracemalloc

import numpy as np
import pytest

import diag_dynamics as dd
from diag_dynamics import batch
from robots import TwoLinkArm, robot_path

ROBOTS = {
    "panda": ("panda_description/urdf/panda.urdf", {}),
    "panda, free": ("panda_description/urdf/panda.urdf", {"mimic": "free"}),
    "talos, floating": ("talos_data/robots/talos_full_v2.urdf", {"floating_base": True}),
}
ALWAYS = [
    "nu",
    "xi",
    "coriolis",
    "coriolis_unnormalized",
    "gravity",
    "articulated_inertia",
    "articulated_inertia_rate",
    "kinetic_energy",
    "energy_share",
    "base_energy",
    "link_energy",
]
WITH_TAU = ["epsilon", "kappa", "nu_dot", "xi_dot", "power"]


@pytest.fixture(autouse=True)
def small_pieces(monkeypatch):
    """Threads share what one would do alone otherwise."""
    monkeypatch.setattr(batch, "LEAST", 16)


@pytest.fixture(scope="module", params=ROBOTS)
def dyn(request):
    path, options = ROBOTS[request.param]
    return dd.DiagonalDynamics(dd.load_urdf(robot_path(path), **options))


@pytest.fixture(scope="module")
def two():
    return dd.DiagonalDynamics(dd.load_urdf(TwoLinkArm().urdf))


def states(dyn, count, seed=0):
    rng = np.random.default_rng(seed)
    Q = np.tile(dyn.model.neutral, (count, 1))
    Q[:, 7 * dyn.model.floating_base :] += rng.uniform(-1.0, 1.0, (count, dyn.model.nq - 7 * dyn.model.floating_base))
    return Q, *rng.standard_normal((2, count, dyn.model.nv))


def assert_same(many, singles, fields):
    """To the last bit where the sweep wrote it, else but for the order of a sum."""
    assert len(many) == len(singles)
    for field in fields:
        expected = np.array([getattr(s, field) for s in singles])
        got = getattr(many, field)
        assert got.shape == expected.shape, field
        if field in ("kinetic_energy", "base_energy", "power"):
            scale = [
                max(s.kinetic_energy, np.abs(s.nu * (s.nu_dot if s.epsilon is not None else 0)).sum()) for s in singles
            ]
            assert (np.abs(got - expected) <= 1e-14 * len(singles[0].nu) * np.array(scale)).all(), field
        else:
            np.testing.assert_array_equal(got, expected, err_msg=field)


@pytest.mark.parametrize("threads", [1, 2, 5, None])
def test_batch_is_single_calls(dyn, threads):
    Q, QD, TAU = states(dyn, 300)
    batch = dyn.evaluate_batch(Q, QD, TAU, threads=threads)
    singles = [dyn.evaluate(q, qd, tau) for q, qd, tau in zip(Q, QD, TAU, strict=True)]
    assert_same(batch, singles, (*ALWAYS, *WITH_TAU))
    assert batch.external is None and batch.friction is None


def test_friction(dyn):
    """ε_fric and all that holds it, as of single calls; with efforts or without."""
    friction = np.linspace(1.0, 2.0, dyn.model.nv)
    rubbing = dd.DiagonalDynamics(dataclasses.replace(dyn.model, friction=friction, damping=0.1 * friction))
    Q, QD, TAU = states(dyn, 300)
    QD[::2] *= 3e-3  # where friction turns round
    batch = rubbing.evaluate_batch(Q, QD, TAU, threads=2, friction=True)
    singles = [rubbing.evaluate(q, qd, tau, friction=True) for q, qd, tau in zip(Q, QD, TAU, strict=True)]
    assert_same(batch, singles, ("friction", "nu_dot", "power"))
    assert np.abs(batch.friction).max() > 1.0
    assert np.array_equal(rubbing.evaluate_batch(Q, QD, friction=True).friction, batch.friction)
    (streamed,) = rubbing.evaluate_stream(Q, QD, size=1000, friction=True)
    assert np.array_equal(streamed.friction, batch.friction)


def test_without_efforts(dyn):
    Q, QD, _ = states(dyn, 200)
    batch = dyn.evaluate_batch(Q, QD)
    assert_same(batch, [dyn.evaluate(q, qd) for q, qd in zip(Q, QD, strict=True)], ALWAYS)
    assert all(getattr(batch, field) is None for field in WITH_TAU)


@pytest.mark.parametrize("count", [0, 1, 7, 8, 9, 63, 64, 129])
def test_any_number_of_states(dyn, count):
    Q, QD, TAU = states(dyn, count)
    batch = dyn.evaluate_batch(Q, QD, TAU, threads=2)
    assert batch.nu.shape == batch.energy_share.shape == (count, dyn.model.nv)
    assert batch.kinetic_energy.shape == batch.power.shape == (count,)
    assert batch.link_energy.shape == (count, len(dyn.model.link_names))
    for t in range(count):
        np.testing.assert_array_equal(batch.coriolis[t], dyn.evaluate(Q[t], QD[t], TAU[t]).coriolis)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there are no forks here")
@pytest.mark.filterwarnings("ignore:.*multi-threaded.*:DeprecationWarning")
def test_a_fork_has_threads_of_its_own(two):
    """It does not wait for those of its parent, which are not there."""
    Q, QD, TAU = states(two, 300)
    expected = two.evaluate_batch(Q, QD, TAU, threads=2).nu
    child = os.fork()
    if not child:
        os._exit(not np.array_equal(two.evaluate_batch(Q, QD, TAU, threads=2).nu, expected))
    assert os.waitpid(child, 0)[1] == 0


LONG = 120.0
"""How long anything may take [s]. Only a failing test waits so long."""


def waits(thread, interrupted):
    """Whether a thread waits for others, and how often that was interrupted and begun anew."""
    names = [frame.f_code.co_name for frame, _ in traceback.walk_stack(sys._current_frames()[thread.ident])]
    return names[0] == "wait" and names.count("_wait_for") >= interrupted


def until(condition, meanwhile=lambda: None):
    """Wait for a condition that nobody tells of, and do something again and again."""
    deadline = time.monotonic() + LONG
    while not condition():
        assert time.monotonic() < deadline
        meanwhile()
        time.sleep(0.001)


@pytest.mark.parametrize("signals", [1, 2])
def test_no_thread_writes_after_a_ctrl_c(two, monkeypatch, signals):
    """While the calling thread waits for the others: it goes on waiting, however often it is interrupted."""
    Q, QD, TAU = states(two, 300)
    out, evaluate_many = two.evaluate_batch(Q, QD, TAU, threads=2, out=two.new_batch(300)), batch.sweeps.evaluate_many
    main, writing, shared, come = threading.main_thread(), *(threading.Event() for _ in range(3))
    heard, ended = [], []

    def interrupted(*_):
        heard.append(True)
        raise KeyboardInterrupt

    def interrupt():
        signal.pthread_kill(main.ident, signal.SIGINT)

    def slow(*arguments):
        if threading.current_thread() is main:
            assert writing.wait(LONG)  # or there would be nothing left for the other one
            done = evaluate_many(*arguments)
            shared.set()
            return done
        writing.set()
        assert shared.wait(LONG)
        until(lambda: waits(main, 0))
        for k in range(1, signals + 1):
            until(
                lambda k=k: len(heard) >= k, interrupt
            )  # one that comes just before a thread begins to wait wakes nobody
            until(lambda k=k: waits(main, k) or come.is_set())
        done = evaluate_many(*arguments)
        ended.append(come.is_set())
        return done

    monkeypatch.setattr(batch.sweeps, "evaluate_many", slow)
    monkeypatch.setattr(batch, "PIECES", 1)
    before = signal.signal(signal.SIGINT, interrupted)
    try:
        with pytest.raises(KeyboardInterrupt):
            two.evaluate_batch(Q, QD, TAU, threads=2, out=out)
        come.set()
    finally:
        signal.signal(signal.SIGINT, before)
    assert ended == [False]
    assert np.isnan(out.nu).all()


def test_arguments_of_any_kind(two):
    Q, QD, TAU = states(two, 100)
    expected = two.evaluate_batch(Q, QD, TAU).nu_dot
    frozen = Q.copy()
    frozen.flags.writeable = False
    for other in (Q.tolist(), np.asfortranarray(Q), frozen, np.repeat(Q, 2, axis=0)[::2]):
        np.testing.assert_array_equal(two.evaluate_batch(other, QD, TAU).nu_dot, expected)
    whole = two.evaluate_batch(np.ones((3, 2), dtype=int), np.ones((3, 2), dtype=np.float32))
    np.testing.assert_array_equal(whole.nu, [two.evaluate([1, 1], [1, 1]).nu] * 3)


@pytest.mark.parametrize("size", [1, 7, 100, 1000])
def test_stream_is_the_batch(two, size):
    Q, QD, TAU = states(two, 100)
    pieces = list(two.evaluate_stream(Q, QD, TAU, size=size))
    assert [len(piece) for piece in pieces[:-1]] == [size] * (len(pieces) - 1)
    np.testing.assert_array_equal(np.concatenate([p.coriolis for p in pieces]), two.evaluate_batch(Q, QD, TAU).coriolis)
    assert next(iter(two.evaluate_stream(Q, QD, size=size))).epsilon is None


def test_stream_takes_bounded_memory(two, tmp_path):
    """Twenty times the states, from files, take no more of it."""
    peaks = []
    for count in (20_000, 400_000):
        files = [np.lib.format.open_memmap(tmp_path / f"{name}_{count}.npy", "w+", shape=(count, 2)) for name in "ab"]
        Q, QD = (np.load(file.filename, mmap_mode="r") for file in files)
        tracemalloc.start()
        energy = sum(piece.kinetic_energy.sum() for piece in two.evaluate_stream(Q, QD, size=5000))
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        assert energy == 0.0
    assert peaks[1] < 1.1 * peaks[0] + 100_000


@pytest.mark.parametrize("at", [0, 70, 199])
@pytest.mark.parametrize(("which", "value"), [("q", np.nan), ("qd", np.inf), ("tau", -np.inf)])
def test_first_failing_state_is_named(dyn, at, which, value):
    arguments = dict(zip(("q", "qd", "tau"), states(dyn, 200), strict=True))
    arguments[which][at, -1] = arguments[which][199, -1] = value
    name = (dyn.model.coordinate_names if which == "q" else dyn.model.dof_names)[-1]
    with pytest.raises(dd.InputError) as caught:
        dyn.evaluate_batch(*arguments.values(), threads=3)
    assert str(caught.value) == f"state {at}: {which} of joint '{name}' is {value}, expected a finite number."
    good = states(dyn, 3)
    assert np.isfinite(dyn.evaluate_batch(*good).nu_dot).all()


def test_singular_state_is_named():
    dyn = dd.DiagonalDynamics(dd.load_urdf(robot_path("icub_description/robots/icub.urdf"), mimic="free"))
    Q, QD, _ = states(dyn, 130)
    Q[100] = 0.0
    with pytest.raises(dd.SingularMassMatrixError, match=r"^state 100: .*neck_roll") as caught:
        dyn.evaluate_batch(Q, QD)
    assert caught.value.joint == "neck_roll"


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda d: d.evaluate_batch([0, 0], [[0, 0]]), "Q has shape (2,), expected (T, 2)"),
        (lambda d: d.evaluate_batch([[0, 0, 0]], [[0, 0]]), "Q has shape (1, 3), expected (T, 2)"),
        (lambda d: d.evaluate_batch([[0, 0]], [[0, 0]] * 2), "QD has shape (2, 2), expected (1, 2)"),
        (lambda d: d.evaluate_batch([[0, 0]], [[0, 0]], [0, 0]), "TAU has shape (2,), expected (1, 2)"),
        (lambda d: d.evaluate_batch([[0, 0], [1]], [[0, 0]]), "Q is not an array of numbers"),
        (lambda d: d.evaluate_batch([["a", "b"]], [[0, 0]]), "Q is not an array of numbers: it has dtype"),
        (lambda d: d.evaluate_batch([[0, 0]], [[0, 0]], threads=0), "threads is 0, expected a whole number >= 1."),
        (lambda d: d.evaluate_batch([[0, 0]], [[0, 0]], threads=1.5), "threads is 1.5, expected a whole number >= 1."),
        (lambda d: list(d.evaluate_stream([[0, 0]], [[0, 0]], size=0)), "size is 0, expected a whole number >= 1."),
        (lambda d: list(d.evaluate_stream([[0, 0]], [])), "QD has 0 states, expected as many as Q, 1."),
    ],
)
def test_wrong_arguments_are_named(two, call, message):
    with pytest.raises(dd.InputError) as caught:
        call(two)
    assert message in str(caught.value)
