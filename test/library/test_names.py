# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Robots by their names, and joints by theirs: what is given by name is never taken by position."""

import sys
import textwrap

import numpy as np
import pytest

import diag_dynamics as dd
from robots import robot


@pytest.fixture(scope="module")
def dyn():
    return dd.DiagonalDynamics(dd.load_robot("panda"))


@pytest.fixture
def state(dyn):
    rng = np.random.default_rng(2)
    return dyn.model.random(rng), rng.normal(size=dyn.model.nv), rng.normal(size=dyn.model.nv)


# --- robots


def test_robots_by_name():
    assert dd.load_robot("panda").dof_names == dd.load_urdf(robot("panda_description/urdf/panda.urdf").urdf).dof_names
    assert dd.load_robot("ur5").name == "ur5"  # of ur5_robot.urdf, not of those with a gripper or with joint limits
    assert dd.load_robot("panda", floating_base=True).floating_base


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("pnada", "did you mean panda"),
        ("ur", "could be any of"),
        ("pand", "could be any of: panda, panda_collision"),
        ("", "expected the name"),
        (3, "expected the name"),
    ],
)
def test_a_name_that_is_none(name, text):
    with pytest.raises(dd.InputError, match=text):
        dd.load_robot(name)


@pytest.fixture
def robot_descriptions(tmp_path, monkeypatch):
    """A stand-in for the package of that name, which clones from the net: one robot is there, another cannot be had."""
    package = tmp_path / "robot_descriptions"
    package.mkdir()
    (package / "__init__.py").write_text(
        textwrap.dedent("""
            class D:
                def __init__(self, has_urdf): self.has_urdf = has_urdf
            DESCRIPTIONS = {"arm_description": D(True), "lost_description": D(True), "bare_description": D(True),
                "xacro_description": D(True), "arm_mj_description": D(False)}
        """)
    )
    (package / "_descriptions.py").write_text((package / "__init__.py").read_text())
    (package / "__init__.py").write_text("")  # as older versions have it
    (package / "bare_description.py").write_text("PACKAGE_PATH = ''")
    (package / "xacro_description.py").write_text(f"XACRO_PATH = {str(tmp_path / 'arm.urdf.xacro')!r}")
    (tmp_path / "arm.urdf.xacro").write_text(robot("ur_description/urdf/ur5_robot.urdf").urdf)
    (package / "arm_description.py").write_text(f"URDF_PATH = {str(tmp_path / 'arm.urdf')!r}")
    (package / "lost_description.py").write_text("raise ConnectionError('no route to host')")
    (tmp_path / "arm.urdf").write_text(robot("ur_description/urdf/ur5_robot.urdf").urdf)
    monkeypatch.syspath_prepend(tmp_path)
    yield
    for name in [name for name in sys.modules if name.split(".")[0] == "robot_descriptions"]:
        del sys.modules[name]


def test_robot_descriptions(robot_descriptions, capsys):
    """Its robots have names, too; that it goes to the net is said, and why it has failed."""
    assert dd.load_robot("arm_description").nv == 6
    assert "from the net" in capsys.readouterr().err
    with pytest.raises(dd.InputError, match=r"lost_description.*ConnectionError: no route to host"):
        dd.load_robot("lost_description")
    with pytest.raises(dd.InputError, match="robot_descriptions has arm_description"):
        dd.load_robot("arm_descripton")
    with pytest.raises(dd.InputError):
        dd.load_robot("arm_mj_description")  # it has no URDF
    with pytest.raises(dd.InputError, match="neither a URDF nor a xacro file"):
        dd.load_robot("bare_description")
    pytest.importorskip("xacro", reason="xacro is not installed")
    assert dd.load_robot("xacro_description").nv == 6


# --- joints


def test_a_dict_is_taken_by_name(dyn, state):
    """In whatever order; results are those of the vectors."""
    q, qd, tau = (dict(reversed(list(zip(dyn.model.dof_names, x, strict=True)))) for x in state)
    by_name, by_position = dyn.evaluate(q, qd, tau), dyn.evaluate(*state)
    assert (by_name.nu == by_position.nu).all() and (by_name.epsilon == by_position.epsilon).all()
    assert (dyn.forward_dynamics(q, qd, tau) == dyn.forward_dynamics(*state)).all()
    assert (dyn.mass_matrix(q) == dyn.mass_matrix(state[0])).all()
    assert (dyn.model.integrate(q, qd) == dyn.model.integrate(*state[:2])).all()


def test_a_series_is_taken_by_name(dyn, state):
    """A reordered one, too; one without names by position."""
    pandas = pytest.importorskip("pandas", reason="pandas is not installed")
    shuffled = np.random.default_rng(0).permutation(dyn.model.nv)
    q, qd, tau = (pandas.Series(x, dyn.model.dof_names).iloc[shuffled] for x in state)
    expected = dyn.evaluate(*state)
    assert (dyn.evaluate(q, qd, tau).nu == expected.nu).all()
    assert (dyn.nu_from_qd(q, qd) == dyn.nu_from_qd(*state[:2])).all()
    assert (dyn.evaluate(*map(pandas.Series, state)).nu == expected.nu).all()
    frame = pandas.DataFrame([state[0]] * 3, columns=dyn.model.dof_names).iloc[:, shuffled]
    rates = pandas.DataFrame([state[1]] * 3, columns=dyn.model.dof_names)
    assert (dyn.evaluate_batch(frame, rates).nu == expected.nu).all()
    twice = pandas.Series(np.zeros(dyn.model.nv), [dyn.model.dof_names[0]] * dyn.model.nv)
    with pytest.raises(dd.InputError, match="q has a name twice: panda_joint1"):
        dyn.mass_matrix(twice)


def test_columns_are_taken_by_name(dyn, state):
    Q, QD, _ = (np.stack([x, 2 * x]) for x in state)
    columns = dict(zip(reversed(dyn.model.dof_names), Q.T[::-1], strict=True))
    assert (dyn.evaluate_batch(columns, QD).nu == dyn.evaluate_batch(Q, QD).nu).all()


def test_names_that_are_wrong(dyn, state):
    q = dict(zip(dyn.model.dof_names, state[0], strict=True))
    with pytest.raises(dd.InputError, match="q has nothing for panda_joint4"):
        dyn.mass_matrix({name: x for name, x in q.items() if name != "panda_joint4"})
    with pytest.raises(dd.InputError, match=r"q has 'panda_jont4'.*is 'panda_joint4' meant"):
        dyn.mass_matrix(q | {"panda_jont4": 0.0})
    with pytest.raises(dd.InputError, match="q of joint 'panda_joint4' is nan"):
        dyn.mass_matrix(q | {"panda_joint4": np.nan})
    with pytest.raises(dd.InputError, match="q is not a vector of numbers"):
        dyn.mass_matrix(q | {"panda_joint4": "x"})


def test_masked_entries_are_refused(dyn, state):
    q = np.ma.masked_array(state[0], mask=np.arange(dyn.model.nv) == 3)
    with pytest.raises(dd.InputError, match="q has 1 masked entries"):
        dyn.mass_matrix(q)
    with pytest.raises(dd.InputError, match="q has 1 masked entries"):
        dyn.evaluate(q, state[1])
    with pytest.raises(dd.InputError, match="Q has 1 masked entries"):
        dyn.evaluate_batch(q[None], state[1][None])
    whole = np.ma.masked_array(state[0], mask=False)
    assert (dyn.mass_matrix(whole) == dyn.mass_matrix(state[0])).all()


def test_names_everywhere(dyn, state):
    """Efforts, damping, gains and samples by name: in simulations, laws and observers; rows of a batch."""
    pandas = pytest.importorskip("pandas", reason="pandas is not installed")
    names, (q, qd, tau) = dyn.model.dof_names, state
    shuffled = [pandas.Series(x, names).iloc[::-1] for x in state]
    one, other = dd.Simulation(dyn.model, q=q, qd=qd), dd.Simulation(dyn.model, q=shuffled[0], qd=shuffled[1])
    damping = np.arange(1.0, dyn.model.nv + 1)
    one.damping, other.damping = damping, dict(zip(names, damping, strict=True))
    one.advance(tau, steps=3)
    other.advance(shuffled[2], steps=3)
    assert (one.q == other.q).all() and (one.nu == other.nu).all()
    gains = damping, pandas.Series(damping, names).iloc[::-1]
    observers = [dd.DisturbanceObserver(dyn, gain=gain, effort="held") for gain in gains]
    for k in range(3):
        a = observers[0].update(0.01 * k, q, qd, tau)
        b = observers[1].update(0.01 * k, *shuffled)
    assert (a.external_torque == b.external_torque).all()
    rows = dyn.evaluate_batch([shuffled[0]] * 2, [dict(shuffled[1])] * 2)
    np.testing.assert_allclose(rows.nu, [dyn.nu_from_qd(q, qd)] * 2, rtol=1e-12, atol=1e-14)
    with pytest.raises(dd.InputError, match="damping"):
        one.damping = pandas.Series(damping, [f"x{k}" for k in range(dyn.model.nv)])


def test_ragged_columns(dyn, state):
    columns = {name: [0.0, 0.0] for name in dyn.model.dof_names} | {"panda_joint3": [0.0]}
    with pytest.raises(dd.InputError, match="Q has not as many entries"):
        dyn.evaluate_batch(columns, np.zeros((2, dyn.model.nv)))
