# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The picture of energies."""

import math

import matplotlib as mpl
import numpy as np
import pytest
from PIL import Image, ImageColor

from diag_dynamics.views.energy_history import PALETTE, EnergyHistory

mpl.use("agg")


def swings(length):
    """Return times [s], energy shares [J] of two joints, and powers [W], which all swing within 0.8 s."""
    t = np.arange(0.0, length, 0.02)
    angle = math.pi / 0.8 * t
    return t, np.stack([2.0 * np.sin(angle) ** 2, np.cos(angle) ** 2 + t / length], axis=1), 8.0 * np.sin(2.0 * angle)


def colour_fractions(path, *colours):
    """Return the fraction of nearly black pixels of a picture, and of those of each colour."""
    pixels = np.array(Image.open(path).convert("RGB"), dtype=int).reshape(-1, 3)
    near = [(abs(pixels - ImageColor.getrgb(colour)).max(axis=1) < 25).mean() for colour in colours]
    return (pixels.max(axis=1) < 100).mean(), *near


@pytest.mark.parametrize("length", [12.0, 600.0])
def test_the_picture_of_a_long_time_is_not_black(tmp_path, length):
    """Each joint has its colour after ten minutes, as after ten seconds."""
    samples = EnergyHistory(["shoulder", "elbow"])
    for t, shares, power in zip(*swings(length), strict=True):
        samples.add(1.7e9 + t, shares, power, 1e-16, 1e-3)
    samples.picture(tmp_path / "energy.png", "arm")
    dark, *of_joints = colour_fractions(tmp_path / "energy.png", *PALETTE[:2])
    assert dark < 0.06 and min(of_joints) > 2.0 * dark
