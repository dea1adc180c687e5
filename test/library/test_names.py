# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Names of the public surface: how many there are, those of other libraries, and one line of
repr.
"""

import copy
import inspect
import pickle
import re
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
import pytest

import diag_dynamics as dd
from diag_dynamics.exceptions import FOREIGN_NAMES
from diag_dynamics.recordings.external_torque import Observed

DOCS = Path(__file__).parents[2] / "docs"
OLD_NAMES = {"jacobian_com", "MjModel", "MjData", "Data"}
"""Names of wrappers and of earlier versions, and classes."""


@pytest.fixture(scope="module")
def dyn():
    """Return the dynamics of the Panda."""
    return dd.DiagonalDynamics(dd.load_robot("panda"))


def objects(dyn):
    """Return the objects of the table by the names that docs give them."""
    return {"dyn": dyn, "model": dyn.model, "dd": dd}


@pytest.mark.parametrize(("here", "names"), FOREIGN_NAMES.items())
def test_names_of_other_libraries(dyn, here, names):
    """Each is an error that has the name here, and is one of Pinocchio or MuJoCo."""
    spec = mujoco.MjModel.from_xml_string("<mujoco/>")
    others = (pin, pin.Model(), pin.Model().createData(), mujoco, spec, mujoco.MjData(spec))
    for part in here.split(" + "):
        owner, attribute = part.split(".")
        assert hasattr(objects(dyn)[owner], attribute)
    for name in names.split():
        assert name in OLD_NAMES or any(hasattr(other, name) for other in others), name
        for thing in objects(dyn).values():
            if thing is not dyn and hasattr(type(dyn.model), name):
                continue  # RobotModel.neutral, integrate, difference
            assert not hasattr(thing, name)
            with pytest.raises(AttributeError, match=re.escape(f"{name!r}; expected {here}.")):
                getattr(thing, name)


def test_docs_have_the_names_of_other_libraries():
    rows = {}
    for line in (DOCS / "names.md").read_text(encoding="utf-8").splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if len(cells) == 4 and "." in cells[0]:
            rows[cells[0].strip("`")] = " ".join(re.findall(r"`(\w+)`", " ".join(cells[1:3])))
            assert cells[3]
    assert rows == FOREIGN_NAMES


def test_objects_with_such_errors_are_copied_and_completed(dyn):
    q = dyn.model.neutral
    expected = dyn.mass_matrix(q)
    for other in (copy.copy(dyn), copy.deepcopy(dyn), pickle.loads(pickle.dumps(dyn))):
        np.testing.assert_array_equal(other.mass_matrix(q), expected)
    assert copy.copy(dyn.model).dof_names == dyn.model.dof_names
    assert not {"rnea", "nle"} & {*dir(dyn), *dir(dyn.model), *dir(dd)}
    assert getattr(dyn, "rnea", None) is None
    with pytest.raises(AttributeError, match=r"dyn\.coriolis_torque \+ dyn\.gravity_torque"):
        dyn.nle  # noqa: B018  # the access itself raises
    with pytest.raises(AttributeError, match="has no attribute 'factr'") as caught:
        dyn.factr  # noqa: B018  # the access itself raises
    assert caught.value.name == "factr" and caught.value.obj is dyn


def test_bars_of_the_public_surface(dyn):
    assert len([name for name in dir(dyn) if not name.startswith("_")]) <= 42
    assert len(dd.__all__) <= 64
    assert set(dd.__all__) <= set(dir(dd))


def test_results_without_a_constructor_live_in_their_modules():
    """Nobody constructs them: methods return them."""
    for name in dd.__all__:
        value = getattr(dd, name)
        assert callable(value) or inspect.ismodule(value)
    for name in ("Excitation", "Identification", "Momentum", "Observed"):
        assert name not in dd.__all__ and not hasattr(dd, name)


def test_repr_has_one_line(dyn):
    n = dyn.model.nv
    q = np.zeros((4, n))
    valid = np.array([False, True, True, True])
    observed = Observed(q, q, valid * 1.0, valid)
    assert repr(dyn) == "<DiagonalDynamics 'panda': 8 dof>"
    assert repr(dd.Simulation(dyn.model)) == "<Simulation 'panda': 8 dof, time 0 s>"
    assert repr(dyn.factors(q[0])) == "<Factors of M: shape (8, 8)>"
    assert repr(dyn.evaluate(q[0], q[0])) == "<Evaluation of 'panda': shape (8,)>"
    assert repr(dyn.evaluate(q, q)) == "<Evaluation of 'panda': shape (4, 8)>"
    assert repr(observed) == "<Observed: 4 states, 3 valid>"


def test_name_of_a_robot_is_no_path():
    with pytest.raises(dd.UrdfError, match="load_robot loads robots by name"):
        dd.load_urdf("panda")
