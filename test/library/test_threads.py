# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""One DiagonalDynamics in several threads: each gets the numbers of its own state."""

import sys
import threading

import numpy as np
import pytest

import diag_dynamics as dd


@pytest.fixture
def often_switched():
    """Threads take turns as often as Python lets them."""
    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(interval)


METHODS = {
    "evaluate": lambda d, q, v, t: d.evaluate(q, v, t).rows[:9],
    "evaluate with all": lambda d, q, v, t: d.evaluate(q, v, t, {"hand": t[:6]}, friction=True).nu_dot,
    "evaluate of lists": lambda d, q, v, t: d.evaluate(q.tolist(), v.tolist(), t.tolist()).rows[:9],
    "forward_dynamics": lambda d, q, v, t: d.forward_dynamics(q, v, t, {"hand": t[:6]}, friction=True),
    "inverse_dynamics": lambda d, q, v, t: d.inverse_dynamics(q, v, t, {"hand": t[:6]}, friction=True),
    "mass_matrix": lambda d, q, v, t: d.mass_matrix(q),
    "mass_matrix_rate": lambda d, q, v, t: d.mass_matrix_rate(q, v),
    "coriolis_product": lambda d, q, v, t: d.coriolis_product(q, v, t),
    "factors": lambda d, q, v, t: d.factors(q).l,
    "nu_from_qd": lambda d, q, v, t: d.nu_from_qd(q.tolist(), v),
    "jacobian": lambda d, q, v, t: d.jacobian(q, "hand", frame="world"),
    "link_acceleration": lambda d, q, v, t: d.link_acceleration(q, v, t, "hand"),
    "wrench_factor": lambda d, q, v, t: d.wrench_factor(q, "hand"),
    "forward_dynamics_batch": lambda d, q, v, t: d.forward_dynamics_batch(q[None], v[None], t[None]),
}


@pytest.mark.parametrize("name", METHODS)
def test_shared_by_threads(name, often_switched):
    """Thousands of calls of two threads at once give what each gives alone, bit for bit."""
    model = dd.load_urdf(ARM)
    dyn, method, rng = dd.DiagonalDynamics(model), METHODS[name], np.random.default_rng(0)
    states = [(model.random(rng), *rng.normal(size=(2, model.nv))) for _ in range(2)]
    expected = [method(dyn, *state) for state in states]
    wrong, ready = [], threading.Barrier(2)

    def work(k):
        ready.wait()
        for _ in range(1500):
            if not (method(dyn, *states[k]) == expected[k]).all():
                wrong.append(k)

    threads = [threading.Thread(target=work, args=(k,)) for k in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong


def _arm(joints=8):
    """URDF of an arm of links with inertia; its last is called hand."""
    names = ["base", *(f"l{k}" for k in range(1, joints)), "hand"]
    inertial = (
        '<inertial><origin xyz="0.1 0.02 0.2"/><mass value="1"/>'
        '<inertia ixx="0.1" iyy="0.12" izz="0.09" ixy="0.01" ixz="0" iyz="0"/></inertial>'
    )
    text = "".join(f'<link name="{name}">{inertial}</link>' for name in names)
    for k in range(joints):
        text += (
            f'<joint name="j{k}" type="revolute"><parent link="{names[k]}"/><child link="{names[k + 1]}"/>'
            f'<origin xyz="0 0.1 0.3" rpy="0.{k} 1 0"/><axis xyz="0 {k % 2} {1 - k % 2}"/>'
            '<limit lower="-3" upper="3" velocity="1" effort="1"/><dynamics damping="0.1" friction="0.2"/></joint>'
        )
    return f'<robot name="arm">{text}</robot>'


ARM = _arm()
