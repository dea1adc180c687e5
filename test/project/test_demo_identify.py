# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""`diag-dynamics demo-identify`: from a wrong model to alarms that work, by one command."""

import re

import numpy as np

import diag_dynamics as dd
from diag_dynamics.cli.main import main


def test_an_arm_from_a_wrong_model_to_alarms(tmp_path, capsys):
    """Ten pushes, of which nine are seen with what was identified; and every file of it can be used."""
    picture, kept = tmp_path / "before_and_after.svg", tmp_path / "kept"
    assert main(["demo-identify", "--robots", "ur5_robot", "--picture", str(picture), "--keep", str(kept)]) == 0
    out, err = capsys.readouterr()
    assert err.startswith("ur5_robot: ")  # it says at once what it does
    seen = re.findall(r"(with the URDF|identified): (\d+) of 10 pushes seen", out)
    assert [what for what, _ in seen] == ["with the URDF", "identified"]
    before, after = (int(number) for _, number in seen)
    assert before < 9 <= after
    shares = re.search(r"explains (\S+) of dK/dt with the URDF, (\S+) identified", out)
    assert float(shares[1]) < 0.0
    assert float(shares[2]) > 0.95
    assert picture.read_text().startswith("<?xml")
    model = dd.load_robot("ur5_robot", parameters=kept / "ur5_robot_arm.yaml")
    recording = dd.read_recording(kept / "ur5_robot_pushed.npz", model)
    assert np.isfinite(dd.observe(dd.DiagonalDynamics(model), recording).norm[100:]).all()
    options = [
        "--parameters",
        str(kept / "ur5_robot_arm.yaml"),
        "--alarms",
        str(kept / "ur5_robot_alarms_identified.yaml"),
    ]
    main(["analyse", str(kept / "ur5_robot_pushed.npz"), "--urdf", "ur5_robot", *options])
    told = capsys.readouterr().out
    assert "collision" in told


def test_errors(tmp_path, capsys):
    assert main(["demo-identify", "--robots", "nobody"]) == 2
    assert "--robots has 'nobody', expected some of panda, ur5_robot, tiago_no_hand" in capsys.readouterr().err
