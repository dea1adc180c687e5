# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Both readers of URDFs, yourdfpy and the one for where it is not installed, give the same models and errors."""

import random
import subprocess
import sys

import pytest

import diag_dynamics as dd
from diag_dynamics.model import urdf
from robots import all_robots, random_robots, random_tree, robot_path


@pytest.fixture
def both(monkeypatch):
    """Function that reads a text by both, and gives what both give: a model, or the text of an error."""
    pytest.importorskip("yourdfpy", reason="yourdfpy is not installed")
    with_it = urdf.yourdfpy

    def outcome(text):
        try:
            return dd.load_urdf(text, massless="lock")
        except dd.DiagDynamicsError as error:
            return f"{type(error).__name__}: {error}"

    def read(text):
        found = []
        for reader in (with_it, None):
            monkeypatch.setattr(urdf, "yourdfpy", reader)
            found.append(outcome(text))
        first, second = found
        if isinstance(first, str):
            assert first == second
            return first
        for name in ("name", "dof_names", "coordinate_names", "joint_names", "link_names", "root_link", "mimics"):
            assert getattr(first, name) == getattr(second, name)
        for name in ("bodies", "links", "lower", "upper", "velocity_limit", "effort_limit", "damping", "friction"):
            assert getattr(first, name).tobytes() == getattr(second, name).tobytes(), name
        for link in first.link_names[-3:]:
            assert first.placement_in_body(link)[1].tobytes() == second.placement_in_body(link)[1].tobytes()
        return first

    return read


@pytest.mark.parametrize("id", all_robots())
@pytest.mark.filterwarnings("ignore::diag_dynamics.InertiaWarning")
def test_example_robots(both, id):
    both(robot_path(id).read_text(encoding="utf-8"))


@pytest.mark.filterwarnings("ignore::diag_dynamics.InertiaWarning")
def test_random_trees(both):
    for one in random_robots():
        assert not isinstance(both(one.urdf), str)
    for seed in range(30, 40):
        both(random_tree(seed, kinds=("revolute", "continuous", "prismatic", "planar", "floating", "fixed")))


@pytest.mark.filterwarnings("ignore::diag_dynamics.InertiaWarning")
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_mutated(both):
    """Pieces of a text thrown away, doubled, swapped or replaced: the same model, or the same words."""
    chance, text = random.Random(11), robot_path("panda_description/urdf/panda.urdf").read_text(encoding="utf-8")
    pieces, refused = text.replace("<", "\0<").replace(" ", "\0 ").split("\0"), 0
    texts = ("nan", "-inf", "1e999", "1 2", "", "x", "0", "-1", "1e-320", "\u0661", "0x1", " 3 ")
    for _ in range(400):
        mutant = pieces.copy()
        for _ in range(chance.randint(1, 3)):
            k = chance.randrange(len(mutant))
            way = chance.randrange(4)
            if way == 0:
                del mutant[k]
            elif way == 1:
                mutant.insert(k, mutant[chance.randrange(len(mutant))])
            elif way == 2:
                j = chance.randrange(len(mutant))
                mutant[k], mutant[j] = mutant[j], mutant[k]
            elif '="' in mutant[k]:
                name, _, rest = mutant[k].partition('="')
                mutant[k] = f'{name}="{chance.choice(texts)}"{rest.partition(chr(34))[2]}'
        refused += isinstance(both("".join(mutant)), str)
    assert 50 < refused < 350


def test_a_yourdfpy_that_is_broken(tmp_path):
    """Its libraries may not go with a NumPy: loading goes on without it, and says so."""
    (tmp_path / "yourdfpy.py").write_text("raise AttributeError('module numpy has no attribute in1d')")
    script = (
        f"import sys; sys.path.insert(0, {str(tmp_path)!r}); import diag_dynamics as dd; "
        f"print(dd.load_urdf({str(robot_path('ur_description/urdf/ur5_robot.urdf'))!r}).nv)"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout == "6\n" and "yourdfpy cannot be imported" in done.stderr
