# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Reports have the library's numbers of the recording, all peaks, and few states."""

import gzip
import io
import os
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

import diag_dynamics as dd
from bags import urdf_of
from diag_dynamics.cli.main import main
from diag_dynamics.page.frames import FrameMaker, States
from diag_dynamics.page.layout import CAUSES
from diag_dynamics.page.meshes import pack, pack_mesh, pack_meshes
from diag_dynamics.page.recording_page import write_report
from diag_dynamics.recordings.analysis import Analysis
from diag_dynamics.recordings.outputs import report as output
from diag_dynamics.recordings.outputs.downsampling import Overview, energy_rate
from diag_dynamics.recordings.recording import Reading
from recorded_arm import ARM, PUSHED, RATE, WATCHED, Recording, parts_of


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    return Recording(tmp_path_factory.mktemp("report"))


# --- Tables ---

PER_DOF = {
    "velocity": ("rad/s", "m/s"),
    "effort": ("N m", "N"),
    "nu": ("J^0.5", "J^0.5"),
    "xi": ("rad/s", "m/s"),
    "kappa": ("N m", "N"),
    "articulated_inertia": ("kg m^2", "kg"),
    "energy_share": ("J", "J"),
    **dict.fromkeys(("epsilon", "coriolis", "gravity", "friction"), ("J^0.5/s", "J^0.5/s")),
}


def test_columns_of_tables(tmp_path):
    """Parquet has units in metadata and NaN, CSV units in the header and empty fields; both have
    the library's numbers.
    """
    xml = urdf_of("turn", "slide").replace('"slide" type="continuous"', '"slide" type="prismatic"')
    xml = xml.replace("</joint>", '<dynamics damping="0.5"/></joint>', 1)
    (tmp_path / "arm.urdf").write_text(xml)
    model = dd.load_urdf(xml)
    t = np.arange(400) / 500.0
    q = np.stack([np.sin(3.0 * t), 0.1 * np.cos(2.0 * t)], axis=1)
    qd = np.gradient(q, t, axis=0)
    tau = np.stack([1.0 + t, 5.0 - t], axis=1)
    tau[100:120, 1] = np.nan
    np.savez(tmp_path / "arm.npz", t=t, q=q, qd=qd, tau=tau)
    paths = [str(tmp_path / name) for name in ("arm.npz", "arm.urdf", "out.parquet", "out.csv")]
    arguments = [
        "analyse",
        paths[0],
        "--urdf",
        paths[1],
        "--parquet",
        paths[2],
        "--csv",
        paths[3],
        "--quiet",
    ]
    assert main(arguments) in (0, 1)
    unknown = np.isnan(tau).any(axis=1)
    s = dd.DiagonalDynamics(model).evaluate(
        q, qd, np.where(unknown[:, None], 0.0, tau), friction=True
    )
    hidden = np.where(unknown, np.nan, 1.0)
    stamps = np.rint(t * 1e9)
    expected = {"stamp": stamps, "oldest_stamp": stamps, "kinetic_energy": s.kinetic_energy}
    expected |= {"base_energy": s.base_energy, "power": s.effort_power * hidden}
    expected |= {
        f"link_energy.{name}": s.link_energy[:, k] for k, name in enumerate(model.link_names)
    }
    units = {"stamp": "ns", "power": "W", "link_energy.link_turn": "J", "collision": ""}
    units |= {"residual.slide": "J^0.5/s", "external_torque.slide": "N"}
    for k, name in enumerate(("turn", "slide")):
        expected |= {f"position.{name}": q[:, k], f"velocity.{name}": qd[:, k]}
        units[f"position.{name}"] = ("rad", "m")[k]
        for quantity, both in PER_DOF.items():
            units[f"{quantity}.{name}"] = both[k]
            if quantity not in ("velocity", "effort"):
                factor = hidden if quantity in ("epsilon", "kappa") else 1.0
                expected[f"{quantity}.{name}"] = getattr(s, quantity)[:, k] * factor
    table = pq.read_table(paths[2])
    for name, numbers in expected.items():
        np.testing.assert_allclose(
            table[name].to_numpy(), numbers, rtol=1e-12, atol=1e-14, err_msg=name
        )
    assert not table["collision"].to_numpy().any()
    for name in (
        "external_torque.slide",
        "residual.slide",
        "residual_norm",
    ):  # the slide moves nothing that turns
        assert np.isnan(table[name].to_numpy()[100:120]).all()
        assert not np.isnan(table["residual.turn"].to_numpy()[1:]).any()
    units_there = {
        field.name: (field.metadata or {}).get(b"unit", b"").decode() for field in table.schema
    }
    assert {name: units_there[name] for name in units} == units
    header, *rows = (line.split(",") for line in Path(paths[3]).read_text().splitlines())
    assert header == [
        f'"{name} [{unit}]"' if unit else f'"{name}"' for name, unit in units_there.items()
    ]
    place = list(units_there).index("power")
    assert [k for k, row in enumerate(rows) if row[place] == ""] == list(np.flatnonzero(unknown))
    np.testing.assert_array_equal(
        dd.read_recording(paths[3], xml).q, q
    )  # written tables are recordings


def test_names_that_are_no_utf8(recording):
    """Of recordings and outputs; a link stays one, and the file that it leads to is replaced."""
    folder = recording.folder / os.fsdecode(b"caf\xe9")
    name = os.fsdecode(b"\xff")
    folder.mkdir()
    (folder / "older").write_text("of yesterday")
    paths = {kind: folder / f"{name}.{kind}" for kind in ("mcap", "parquet", "csv")}
    paths["parquet"].symlink_to(folder / "older")
    options = [word for kind, path in paths.items() for word in (f"--{kind}", path)]
    html, summary = recording.analyse(name, "--quiet", *options, **recording.columns(slice(0, 200)))
    assert html.exists() and summary["recording"] == str(recording.folder / f"{name}.npz")
    assert paths["parquet"].is_symlink() and len(list(folder.iterdir())) == 4
    assert pq.read_table(io.BytesIO((folder / "older").read_bytes())).num_rows == 200


# --- Downsampling ---


def test_no_peak_is_missing_from_the_overview():
    rng = np.random.default_rng(3)
    count = 40_000
    K = np.cumsum(rng.normal(size=count))
    norm = np.abs(rng.normal(size=count))
    norm[::7] = np.nan
    overview = Overview(500)
    index = np.arange(count)
    for first in range(0, count, 7001):
        part = slice(first, first + 7001)
        overview.add({"index": index[part], "K": K[part], "norm": norm[part]})
    states = overview.states()
    assert 120 <= len(states["K"]) <= 500 and (np.diff(states["index"]) > 0).all()
    np.testing.assert_array_equal(states["K"], K[states["index"]])
    assert (states["K"].max(), states["K"].min(), np.nanmax(states["norm"])) == (
        K.max(),
        K.min(),
        np.nanmax(norm),
    )
    assert states["index"][0] == 0 and np.diff(states["index"]).max() < 2 * count // 120


def test_the_rate_of_energy_is_a_mean():
    """Of K = t² it is 2t."""
    t = np.arange(1000) * 1e-3
    np.testing.assert_allclose(energy_rate(t, t * t)[50:950], 2.0 * t[50:950], rtol=1e-6)


# --- How numbers are packed ---


def unpacked(data, rows):
    """Return times and columns by the description of the format, without the page's code."""
    content = gzip.decompress(data)
    planes = np.frombuffer(content, np.uint8, offset=8 * rows).reshape(-1, 3, rows)
    whole = np.zeros((len(planes), rows, 4), np.uint8)
    whole[..., 1:] = planes.swapaxes(1, 2)
    return np.frombuffer(content, "<f8", rows), whole.view("<f4")[..., 0].T


def test_packed_numbers_come_back():
    """To 16 significant bits; times and what is not finite are exact."""
    rng = np.random.default_rng(6)
    t = 1e6 + np.linspace(0.0, 9.0, 3000)
    numbers = rng.normal(size=(3000, 3)) * [1e-9, 1.0, 1e30]
    numbers[5] = np.nan, np.inf, -np.inf
    times, result = unpacked(pack(t, numbers), len(t))
    np.testing.assert_array_equal(times, t)
    np.testing.assert_allclose(result, numbers, rtol=2.0**-16)


def test_meshes_have_fewer_vertices_and_the_largest_are_left_out():
    rng = np.random.default_rng(7)
    points = rng.normal(size=(3000, 3)).astype("<f4")
    faces = rng.integers(0, 3000, (9000, 3)).astype("<u4")
    data = np.array([3000, 9000], "<u4").tobytes() + points.tobytes() + faces.tobytes()
    whole = len(pack_mesh(data))
    assert set(pack_meshes({"a": data, "b": data}, 2 * whole)) == {"a", "b"}
    assert len(pack_meshes({"a": data, "b": data}, whole)) == 1
    assert pack_meshes({"a": data}, 10) == {}
    vertices = np.frombuffer(gzip.decompress(pack_mesh(data)), "<u4", 1)[0]
    assert vertices < 3000 == len(points)


# --- The file ---


def states_in(content, blocks):
    """Return the times of the states of a report, and their fields by name."""
    times, numbers = unpacked(blocks[0], content["states"])
    result = {}
    for field in content["layout"]["fields"]:
        result[field["name"]] = numbers[:, : field["size"]]
        numbers = numbers[:, field["size"] :]
    return times, result


COMPARED = (
    "q",
    "qd",
    "effort",
    "nu",
    "coriolis",
    "D",
    "K",
    "p_effort",
    "p_gravity",
    "contact_limits_worst",
    "contact_limits_position",
    "contact_limits_speed",
    "contact_limits_mass",
    "contact_limits_energy",
    "link_energy",
    "link_velocity",
)
"""Fields of frames that are made without observations."""


def test_the_numbers_are_those_of_frames(recording):
    """To the steps of the packing and the rounding of floats."""
    limits = dd.ContactLimits.load(recording.folder / "limits.yaml")
    options = ["--set", *WATCHED, f"contact_limits.file={recording.folder / 'limits.yaml'}"]
    html, summary = recording.analyse("swing", *options, **recording.columns())
    (collision,) = summary["collisions"]
    assert PUSHED[0] < collision["start"] < PUSHED[0] + 0.2
    content, blocks = parts_of(html)
    assert content["summary"] == summary
    points = dd.link_geometry(recording.model, ARM).points
    points = dd.ContactPoints(recording.model, points, limits, "limit")
    assert [point["name"] for point in content["layout"]["contact_limits"]["points"]] == list(
        points.names
    )
    maker = FrameMaker(recording.dyn, zip(points.names, points.links, strict=True))
    hand = content["layout"]["end_effector"]
    places = maker.layout.places
    t, result = states_in(content, blocks)
    which = np.rint(t * RATE).astype(int)
    np.testing.assert_allclose(t, recording.t[which], atol=2e-6)
    q = recording.q[which]
    qd = recording.qd[which]
    tau = recording.tau[which]
    evaluation = recording.dyn.evaluate(q, qd, tau)
    states = States.of(t, q, qd, tau, evaluation)
    states = states.with_contact_limits(recording.dyn.contact_limits(q, qd, points))
    numbers = maker.frames(states)["numbers"]
    for k, state in enumerate(zip(q, evaluation.nu, strict=True)):
        numbers[k, maker.layout.common :] = maker.chosen(*state, hand)
    for name in COMPARED:
        expected = numbers[:, places[name]]
        size = np.abs(expected).max()
        np.testing.assert_allclose(result[name], expected, 2e-5, 1e-5 * size, err_msg=name)


@pytest.mark.parametrize(
    ("given", "efforts", "missing", "words"),
    [
        (WATCHED[1:], True, ["collision.threshold"], ("threshold is not set", "calibrate")),
        (WATCHED, False, [], ("no efforts",)),
    ],
    ids=["no threshold", "no efforts"],
)
def test_contacts_of_which_nothing_is_known(recording, capsys, given, efforts, missing, words):
    """Summary and text name the missing parameter and do not report zero contacts."""
    columns = recording.columns(slice(750, 1500))  # the push is in it
    if not efforts:
        del columns["tau"]
    _, summary = recording.analyse("part", "--set", *given, **columns)
    observer = summary["observer"]
    printed = " ".join(capsys.readouterr().out.split())
    assert (observer["missing"], observer["observed"], summary["collisions"]) == (
        missing,
        749 * efforts,
        [],
    )
    assert "0 collisions" not in printed and all(
        word in printed for word in ("Collisions are unknown", *words)
    ), printed


def test_states_without_an_effort_are_counted(recording):
    columns = recording.columns()
    columns["tau"] = columns["tau"].copy()
    columns["tau"][2500:2700] = np.nan
    html, summary = recording.analyse("gap", "--quiet", "--set", *WATCHED, **columns)
    unknown = summary["states"] - summary["observer"]["observed"]
    assert 201 <= unknown <= 202 and len(summary["collisions"]) == 1
    assert f"unknown at {unknown} of 4000 states" in summary["observer"]["text"]
    content, blocks = parts_of(html)
    t, result = states_in(content, blocks)
    missing = np.abs(t - 5.2) < 0.18
    assert all(np.isnan(result[name][missing]).all() for name in ("effort", "epsilon", "p_effort"))
    assert all(np.isfinite(result[name]).all() for name in ("coriolis", "K", "p_gravity"))


def test_times_behind_a_long_gap_are_right(recording):
    """Two hours are longer than the 71.6 minutes of 32-bit microseconds. A made model has no points
    of contact.
    """
    columns, path, html = (
        recording.columns(slice(0, 1000)),
        *(recording.folder / f"gap.{kind}" for kind in ("npz", "html")),
    )
    columns["t"] = columns["t"] + 7200.0 * (np.arange(1000) >= 600)
    np.savez(path, **columns)
    reading = Reading(path, recording.model, parameters={"external_torque.gain": 25.0})
    summary = Analysis(reading).run([output.ReportOutput(html, reading)])
    assert summary["recording"] == str(path)
    content, blocks = parts_of(html)
    t = states_in(content, blocks)[0]
    assert t[-1] > 7200.0 and np.isin(np.rint(t * 1e6), np.rint(columns["t"] * 1e6)).all()
    assert content["layout"]["contact_limits"]["points"] == []
    assert content["parameters"][0] == {
        "name": "external_torque.gain",
        "value": "25.0",
        "default": False,
    }
    assert {"true", "false"} <= {row["value"] for row in content["parameters"]}


def test_a_page_that_is_not_built(tmp_path):
    with pytest.raises(dd.InputError, match="make page"):
        write_report(tmp_path / "r.html", {}, b"", {}, static=tmp_path)


def test_contacts_and_the_touched_link(recording):
    """A weak push is a contact and no collision. States of both have the link and the force that
    the library estimates.
    """
    names = recording.model.dof_names
    covariance = np.diag([0.2, 0.3, 0.1]) ** 2
    (recording.folder / "pushes.yaml").write_text(
        f"""/**:
  ros__parameters:
    external_torque: {{gain: 25.0, covariance_joints: {list(names)},
      covariance: {covariance.ravel().tolist()}}}
    collision: {{threshold: [total=30]}}
    contact: {{threshold: [total=5]}}
"""
    )
    t, q, qd, tau = recording.motion(((2.0, 2.3), (5.0, 5.4)), (40.0, 12.0))
    options = "--quiet", "--parameters", recording.folder / "pushes.yaml"
    html, summary = recording.analyse("pushes", *options, t=t, q=q, qd=qd, tau=tau)
    assert [round(entry["start"], 1) for entry in summary["collisions"]] == [2.1]
    assert [round(entry["start"], 1) for entry in summary["contacts"]] == [2.0, 5.0]
    content, blocks = parts_of(html)
    times, fields = states_in(content, blocks)
    flags = fields["flags"][:, 0].astype(int)
    links = recording.model.link_names
    pushed = (flags & (CAUSES["contact"] | CAUSES["collision"])) > 0
    assert all(pushed[np.abs(times - at) < 0.3].sum() > 4 for at in (2.2, 5.2))
    assert np.isnan(fields["touched_link"][~pushed]).all()
    for k in np.flatnonzero(pushed):
        touched = recording.dyn.touched_link(
            fields["q"][k], fields["external_torque"][k], covariance
        )
        assert links[int(fields["touched_link"][k, 0])] == touched.link
        assert fields["touched_probability"][k, 0] == pytest.approx(touched.confidence, abs=1e-2)
