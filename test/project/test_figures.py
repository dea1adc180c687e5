# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The figures of docs/concepts.md: drawn anew they are the ones that are there, and they show what the page says."""

import importlib
import re
import sys
from pathlib import Path

import numpy as np
import pytest

pytestmark = [pytest.mark.full]

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "docs" / "figures"

pytest.importorskip("matplotlib", reason="matplotlib is not installed")


@pytest.fixture(scope="module", autouse=True)
def figures():
    """Have the scripts import one another, as they do when draw.py runs."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(FOLDER))
        before = set(sys.modules)
        yield
        for name in set(sys.modules) - before:
            if str(FOLDER) in str(getattr(sys.modules[name], "__file__", "")):
                del sys.modules[name]


def data(name):
    return importlib.import_module(name).data()


def numbers_and_text(path):
    """Return the numbers of an SVG, and all else; what is random or of the library's version is left out."""
    text = re.sub(r"<metadata>.*?</metadata>", "", path.read_text(encoding="utf-8"), flags=re.S)
    text = re.sub(r"\b[mp][0-9a-f]{10}\b", "id", text)  # matplotlib's names of paths
    found = r"(?<![\w#])-?\d+(?:\.\d+)?(?:e-?\d+)?"
    return np.array([float(number) for number in re.findall(found, text)]), re.sub(found, "0", text)


def test_they_are_up_to_date(tmp_path):
    """To a tenth of a point: another processor may round otherwise."""
    draw = importlib.import_module("draw")
    draw.draw(tmp_path)
    assert {path.name for path in FOLDER.glob("*.svg")} == {path.name for path in tmp_path.iterdir()}
    for path in sorted(tmp_path.iterdir()):
        (drawn, text), (kept, kept_text) = numbers_and_text(path), numbers_and_text(FOLDER / path.name)
        assert text == kept_text, f"{path.name}: python docs/figures/draw.py"
        np.testing.assert_allclose(drawn, kept, atol=0.1, err_msg=f"{path.name}: python docs/figures/draw.py")


def test_free_joints_have_no_total_rates():
    """Held joints have total rates, free ones none; and these move with the least energy for this shoulder."""
    from own_and_induced import POSTURE
    from rods import model

    import diag_dynamics as dd

    held, free, total_held, total_free = data("own_and_induced")
    assert np.abs(total_held[1:]).min() > 1.0 and np.abs(total_free[1:]).max() < 1e-12
    M = dd.DiagonalDynamics(model()).mass_matrix(POSTURE)
    least = -np.linalg.solve(M[1:, 1:], M[1:, 0])
    np.testing.assert_allclose(free[1:], least, rtol=1e-10)
    assert held @ M @ held > free @ M @ free


def test_free_joints_give_way():
    """D₁ is at most M₁₁, and what is left of M when the outer joints are taken out."""
    from rods import model

    import diag_dynamics as dd

    elbow, rigid, free = data("articulated_inertia")
    assert np.all(free <= rigid) and rigid[0] > 5.0 * free[0]
    M = dd.DiagonalDynamics(model()).mass_matrix([0.0, elbow[40], 0.0])
    assert free[40] == pytest.approx(M[0, 0] - M[0, 1:] @ np.linalg.solve(M[1:, 1:], M[1:, 0]), rel=1e-10)


def test_energy_goes_round_and_none_is_made():
    """Shares change by more than a half of K, while K stays and flows add up to nothing."""
    _, shares, flows = data("energy_exchange")
    total = shares.sum(axis=1)
    assert np.ptp(total) < 1e-9 * total[0] and np.ptp(shares, axis=0).min() > 0.4 * total[0]
    assert np.abs(flows.sum(axis=1)).max() < 1e-12 * np.abs(flows).max()


def test_m_is_emptier_than_the_mass_matrix():
    M, m = data("factors")
    np.testing.assert_allclose(m @ m.T, M, atol=1e-12 * np.abs(M).max())
    assert np.count_nonzero(np.tril(m, -1)) == 0
    assert np.count_nonzero(m) < 0.6 * np.count_nonzero(np.abs(M) > 1e-9)
