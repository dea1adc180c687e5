# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Many states at once: the numbers of single calls, on any number of threads."""

import os
import platform
import re
import signal
import sys
import threading

import numba
import numpy as np
import pytest

import diag_dynamics as dd
from accuracy import QUANTITIES
from diag_dynamics import threads as helpers
from diag_dynamics.sweeps import batch as kernels
from diag_dynamics.sweeps import kinematics, spatial
from examples import shortened
from limits import HANG
from robots import KINDS, SEVERAL, TwoLinkArm, random_tree, robot_path

COUNT = 150
"""States of a batch: several pieces for each thread."""

MODELS = {
    "panda": lambda: dd.load_robot("panda"),
    "go2, floating": lambda: dd.load_robot("go2", floating_base=True),
    "random tree": lambda: dd.load_urdf(random_tree(20, kinds=(*KINDS, *SEVERAL))),
}


@pytest.fixture(autouse=True)
def small_pieces(monkeypatch):
    """Let few states be enough for several threads."""
    monkeypatch.setattr(helpers, "MIN_CHUNK", 16)


def with_friction(model):
    """Return the model with friction in each joint."""
    entry = {"damping": 0.3, "friction": 1.5, "effort_offset": 0.1}
    single = [name for name in model.joint_names if name in model.dof_names]
    return model.with_parameters(
        {"joints": dict.fromkeys(single, entry), "friction_velocity": 0.05}
    )


@pytest.fixture(scope="module", params=MODELS)
def dyn(request):
    return dd.DiagonalDynamics(with_friction(MODELS[request.param]()))


@pytest.fixture(scope="module")
def two():
    return dd.DiagonalDynamics(dd.load_urdf(TwoLinkArm().urdf))


def states(dyn, count=COUNT, seed=0):
    """Return positions, rates and efforts, a row for each state."""
    rng = np.random.default_rng(seed)
    Q = np.array([dyn.model.random(rng) for _ in range(count)]).reshape(count, dyn.model.nq)
    return Q, *rng.standard_normal((2, count, dyn.model.nv))


# --- Numbers of single calls


@pytest.mark.parametrize(
    ("threads", "count"), [(2, 0), (1, 1), (1, 9), (2, 64), (5, COUNT), (None, COUNT)]
)
@pytest.mark.parametrize("efforts", [False, True], ids=["without efforts", "with efforts"])
def test_batch_equals_single_evaluations(dyn, threads, count, efforts):
    """Batches may be empty, shorter and longer than WIDTH and the pieces of threads."""
    Q, QD, *TAU = states(dyn, count)[: 2 + efforts]
    many = dyn.evaluate(Q, QD, *TAU, threads=threads, friction=True)
    singles = [dyn.evaluate(*state, friction=True) for state in zip(Q, QD, *TAU, strict=True)]
    assert len(many.nu) == count
    for name in QUANTITIES if count else ():
        expected = [getattr(single, name) for single in singles]
        if expected[0] is None:
            assert getattr(many, name) is None, name
        else:
            np.testing.assert_array_equal(getattr(many, name), expected, err_msg=name)


def forces(dyn, tau, frame="link"):
    """Return friction, a wrench of the base, and one of the last link, a function of efforts."""
    wrenches = {dyn.model.link_names[0]: np.ones(6), dyn.model.link_names[-1]: tau[..., :6]}
    return {"f_ext": wrenches, "friction": True, "frame": frame}


METHODS = {
    "evaluate": lambda d, q, v, t, **o: d.evaluate(q, v, t, **forces(d, t), **o).nu_dot,
    "power": lambda d, q, v, t, **o: d.evaluate(q, v, t, **forces(d, t, "world"), **o).power,
    "forward_dynamics": lambda d, q, v, t, **o: d.forward_dynamics(q, v, t, **forces(d, t), **o),
    "inverse_dynamics": lambda d, q, v, t, **o: d.inverse_dynamics(
        q, v, t, **forces(d, t, "world"), **o
    ),
    "mass_matrix": lambda d, q, v, t, **o: d.mass_matrix(q, **o),
    "inverse_mass_matrix": lambda d, q, v, t, **o: d.inverse_mass_matrix(q, **o),
    "factors": lambda d, q, v, t, **o: d.factors(q, **o).m,
    "potential_energy": lambda d, q, v, t, **o: d.potential_energy(q, **o),
    "center_of_mass": lambda d, q, v, t, **o: d.center_of_mass(q, **o),
    "regressor": lambda d, q, v, t, **o: d.regressor(q, v, v, **o),
    "coriolis_torque": lambda d, q, v, t, **o: d.coriolis_torque(q, v, **o),
    "gravity_torque": lambda d, q, v, t, **o: d.gravity_torque(q, **o),
    "friction_torque": lambda d, q, v, t, **o: d.friction_torque(v, **o),
    "momentum": lambda d, q, v, t, **o: np.hstack(d.momentum(q, v, **o)),
    "nu_from_qd": lambda d, q, v, t, **o: d.nu_from_qd(q, v, **o),
    "qd_from_nu": lambda d, q, v, t, **o: d.qd_from_nu(q, v, **o),
    "epsilon_from_tau": lambda d, q, v, t, **o: d.epsilon_from_tau(q, t, **o),
    "tau_from_epsilon": lambda d, q, v, t, **o: d.tau_from_epsilon(q, t, **o),
}
"""Methods of one state or rows."""


@pytest.mark.parametrize("name", METHODS)
def test_rows_equal_single_calls(dyn, name):
    """Positions are arrays, lists, dicts, or columns by name."""
    Q, QD, TAU = states(dyn)
    method = METHODS[name]
    expected = [method(dyn, *state) for state in zip(Q, QD, TAU, strict=True)]
    for threads in (1, 2, None):
        result = method(dyn, Q, QD, TAU, threads=threads)
        np.testing.assert_allclose(result, expected, rtol=1e-11, atol=1e-11)
    names = dyn.model.coordinate_names
    dicts = [dict(zip(names, q, strict=True)) for q in Q]
    for rows in (Q.tolist(), dicts, dict(zip(names, Q.T, strict=True))):
        np.testing.assert_array_equal(method(dyn, rows, QD, TAU), result)


def evaluation_step(robot):
    at = kernels.ws.robot_of(robot)
    kernels._outward_joint(spatial.ANGULAR_Z, at, 1)
    kernels._inward_joint(spatial.ANGULAR_Z, at, 1)


def base_step(robot):
    at = kernels.ws.robot_of(robot)
    kernels._outward_base(at, 1)
    kernels._inward_base(at, 6)


@pytest.mark.skipif(
    platform.machine() != "x86_64", reason="names of instructions are those of x86-64"
)
@pytest.mark.parametrize("step", [evaluation_step, base_step])
def test_steps_side_by_side_are_vectorized(step):
    """Scalar instructions would give the same numbers in more than twice the time."""
    compiled = numba.njit("(int64,)", error_model="numpy")(step)
    code = "\n".join(compiled.inspect_asm().values())
    packed, scalar = (len(re.findall(rf"v?(?:add|sub|mul){kind}\s", code)) for kind in ("pd", "sd"))
    assert packed > 300 and scalar < 0.1 * packed, (packed, scalar)


# --- Arguments


@pytest.mark.parametrize("at", [0, 70, 149])
@pytest.mark.parametrize(("which", "value"), [("q", np.nan), ("qd", np.inf), ("tau", -np.inf)])
def test_error_names_the_first_bad_state(dyn, at, which, value):
    arguments = dict(zip(("q", "qd", "tau"), states(dyn), strict=True))
    arguments[which][at, -1] = arguments[which][149, -1] = value
    name = (dyn.model.coordinate_names if which == "q" else dyn.model.dof_names)[-1]
    for call in (dyn.evaluate, dyn.forward_dynamics):
        with pytest.raises(dd.InputError) as caught:
            call(*arguments.values(), threads=3)
        assert str(caught.value).startswith(f"state {at}: {which} of joint '{name}' is {value}")
    assert np.isfinite(dyn.evaluate(*states(dyn, 3)).nu_dot).all()


def test_error_names_the_singular_state():
    dyn = dd.DiagonalDynamics(
        dd.load_urdf(robot_path("icub_description/robots/icub.urdf"), mimic="free")
    )
    Q, QD, _ = states(dyn, 130)
    Q[100] = 0.0
    with pytest.raises(dd.SingularMassMatrixError, match=r"^state 100:") as caught:
        dyn.evaluate(Q, QD)
    assert caught.value.joint == "neck_roll"


STATE = [[0.0, 0.0]]
FAST = [[1e140, 0.0]]
NAN, LARGE = [[0.0, np.nan]], {"lower": np.full(6, 1.7e308)}

WRONG = {
    "first moment": (lambda d: d.potential_energy(NAN), "state 0: q of joint 'elbow' is nan"),
    "accelerations": (lambda d: d.regressor(STATE, STATE, NAN), "state 0: qdd of joint 'elbow'"),
    "one state": (lambda d: d.evaluate([0, 0], STATE), "qd has shape (1, 2); expected (2,)"),
    "rates": (lambda d: d.evaluate(STATE, STATE * 2), "qd has shape (2, 2); expected (1, 2)"),
    "half a thread": (lambda d: d.coriolis_torque(STATE, STATE, threads=1.5), "threads is 1.5"),
    "wrenches": (
        lambda d: d.evaluate(STATE, STATE, STATE, {"lower": np.zeros((3, 6))}),
        "(1, 6)",
    ),
    "rates of coriolis_torque": (
        lambda d: d.coriolis_torque(STATE, NAN),
        "state 0: qd of joint 'elbow'",
    ),
    "large wrench": (lambda d: d.evaluate(STATE, STATE, STATE, LARGE), "f_ext is too large"),
    "large power": (
        lambda d: d.evaluate(STATE, FAST, STATE, {"lower": np.full(6, 1e180)}),
        "power overflows",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_arguments(two, case):
    call, key = WRONG[case]
    with pytest.raises(dd.InputError) as caught:
        call(two)
    assert key in str(caught.value)


# --- Threads


@pytest.mark.parametrize("interrupts", [1, 2])
def test_no_thread_writes_after_ctrl_c(two, monkeypatch, interrupts):
    """The calling thread waits for its helpers, even if Ctrl-C interrupts that wait."""
    Q, QD, TAU = states(two, 300)
    evaluate_many = kernels.evaluate_many
    wait = helpers.wait
    main = threading.current_thread()
    helper_began = threading.Event()
    may_end = threading.Event()
    ended = []
    waits = []

    def evaluate(*arguments):
        if threading.current_thread() is main:
            assert helper_began.wait(HANG)
            raise KeyboardInterrupt
        helper_began.set()
        assert may_end.wait(HANG)
        ended.append(evaluate_many(*arguments))
        return ended[-1]

    def wait_for(others):
        waits.append(others)
        if len(waits) < interrupts:
            raise KeyboardInterrupt
        may_end.set()
        return wait(others)

    monkeypatch.setattr(helpers, "CHUNKS_PER_THREAD", 1)
    monkeypatch.setattr(helpers, "wait", wait_for)
    monkeypatch.setattr(kernels, "evaluate_many", evaluate)
    with pytest.raises(KeyboardInterrupt):
        two.evaluate(Q, QD, TAU, threads=2)
    assert len(ended) == 1 and len(waits) == interrupts


@pytest.mark.full  # forks the process of the test
@pytest.mark.filterwarnings("ignore:.*multi-threaded.*:DeprecationWarning")
def test_forked_process_has_threads_of_its_own(two):
    Q, QD, TAU = states(two)
    expected = two.evaluate(Q, QD, TAU, threads=2).nu
    if child := os.fork():
        assert os.waitpid(child, 0)[1] == 0
    else:
        signal.alarm(int(HANG))
        os._exit(not np.array_equal(two.evaluate(Q, QD, TAU, threads=2).nu, expected))


@pytest.fixture
def frequent_switches():
    """Let threads take turns as often as Python can."""
    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(interval)


SHARED = METHODS | {
    "factors": lambda d, q, v, t: d.factors(q).l,
    "jacobian": lambda d, q, v, t: d.jacobian(q, "panda_hand", frame="world"),
    "wrench_factor": lambda d, q, v, t: d.wrench_factor(q, "panda_hand"),
    "wrench": lambda d, q, v, t: d.wrench(q, "panda_hand", t).wrench,
    "rows": lambda d, q, v, t: d.forward_dynamics(q[None], v[None], t[None]),
}


@pytest.mark.parametrize("name", SHARED)
def test_threads_share_one_dynamics(name, frequent_switches):
    """Two threads that call at once get the bits that each gets alone."""
    dyn = dd.DiagonalDynamics(with_friction(dd.load_robot("panda", mimic="free")))
    method = SHARED[name]
    two_states = list(zip(*states(dyn, 2), strict=True))
    expected = [method(dyn, *state) for state in two_states]
    wrong = []
    ready = threading.Barrier(2)

    def work(k):
        ready.wait()
        for _ in range(shortened(1500, 300)):
            if not np.array_equal(method(dyn, *two_states[k]), expected[k]):
                wrong.append(k)

    threads = [threading.Thread(target=work, args=(k,)) for k in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong
    assert not kinematics.jacobians._nogil  # races in so short a sweep are rare
