# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a touch would cost, as a page gets it."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

import diag_dynamics as dd
from diag_dynamics.page.contact import Touch, mass_of_half, told
from diag_dynamics.page.show import Show
from robots import description, joint, link

BLOCK = (2.0, (0.0, 0.0, 0.1), (0.01, 0.0, 0.0, 0.01, 0.0, 0.01))


def arm():
    return dd.load_urdf(
        description(
            "arm",
            link("base", *BLOCK),
            link("upper", *BLOCK),
            link("lower", *BLOCK),
            joint("shoulder", "revolute", "base", "upper", xyz=(0, 0, 0.2)),
            joint("elbow", "revolute", "upper", "lower", xyz=(0, 0, 0.2)),
        )
    )


def touch(t=1.0):
    numbers = {"speed": [0.5, 0.0], "mass": [3.0, 0.0], "energy": [0.375, 0.0], "allowed": [0.4, np.inf]}
    arrays = {name: np.array(values) for name, values in numbers.items()}
    return Touch(t, ["a", "b"], ["upper", "lower"], np.arange(6.0), **arrays, worst=0, estimated=False)


def test_half_of_what_moves_and_all_that_is_carried():
    model = arm()
    assert mass_of_half(model) == pytest.approx(2.0)
    assert mass_of_half(model.with_payload("lower", 1.5, (0.0, 0.0, 0.1))) == pytest.approx(3.5)
    assert mass_of_half(model.with_payload("base", 1.5, (0.0, 0.0, 0.1))) == pytest.approx(2.0)


def test_told_without_infinities():
    first, second = json.loads(told(touch(), arm()))["points"]
    assert first["margin"] == pytest.approx(-0.1)
    assert first["position"] == [0.0, 1.0, 2.0]
    assert second["margin"] is second["allowed"] is None
    away = touch()._replace(speed=np.array([-0.2, 0.0]))  # a point that moves against a direction that is given
    assert json.loads(told(away, arm()))["points"][0]["margin"] == pytest.approx(0.4)
    assert (second["name"], second["link"], second["energy"]) == ("b", "lower", 0.0)


def test_a_show_tells_it_once_and_seldom(monkeypatch):
    """Whoever asks: the newest is taken at most ten times a second, and of no robot nothing is."""
    taken, now = [], [50.0]
    monkeypatch.setattr("diag_dynamics.page.show.time", SimpleNamespace(monotonic=lambda: now[0]))
    show = Show("/arm", lambda _: None, lambda dynamics: taken.append(dynamics) or touch(float(len(taken))))
    assert show.touch() == (0, b"")
    show.use(dd.DiagonalDynamics(arm()), None, None)
    number, text = show.touch()
    assert number == 1
    assert json.loads(text)["t"] == 1.0
    now[0] += 0.09
    assert show.touch() == (1, text)
    assert len(taken) == 1
    now[0] += 0.02
    assert show.touch()[0] == len(taken) == 2
