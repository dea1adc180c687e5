# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Reports: one file, without a network, in which the numbers of the recording are."""

import csv
import gzip
import json
import os
import re
from pathlib import Path

import numpy as np
import pytest

import diag_dynamics as dd
from bags import odometry, write_floating
from browser import Tab, browser
from diag_dynamics.cli.main import main
from diag_dynamics.exceptions import InputError
from diag_dynamics.model.example_robots import find_urdf
from diag_dynamics.page.contact import mass_of_half
from diag_dynamics.page.packing import LEVELS, pack, pack_mesh, pack_meshes
from diag_dynamics.page.report import write_report
from diag_dynamics.recordings.analysis import Analysis
from diag_dynamics.recordings.outputs import report as output
from diag_dynamics.recordings.outputs.telling import AROUND, Contacts, Overview, Rows, Works, mean_powers, telling
from diag_dynamics.recordings.recording import Reading
from diag_dynamics.recordings.summary import summary_of
from hostile import START, Driver

pytest.importorskip("yourdfpy")
RECORDINGS = Path(
    os.environ.get("DIAG_DYNAMICS_RECORDINGS", Path(__file__).parents[2].parent / "shared" / "recordings")
)
RATE, LENGTH, PUSHED = 1000.0, 14.0, (4.0, 4.5)
LARGEST = 15e6
"""Of the report of an hour at 1 kHz [bytes]."""


# --- Which states are kept ---


def rows_of(t, K, collision, rng):
    count = len(t)
    vectors = rng.normal(size=(count, 2))
    work, unknown = Works().take(t, rng.normal(size=(count, 4)))
    norm, valid = np.abs(rng.normal(size=count)), np.ones(count, dtype=bool)
    same = dict.fromkeys(Rows._fields, vectors)
    flags = {"valid": valid, "collision": collision, "estimated": ~valid, "received": ~valid}
    return Rows(**same | {"t": t, "K": K, "norm": norm, "work": work, "unknown": unknown} | flags)


def test_no_peak_is_missing_from_the_overview():
    rng = np.random.default_rng(3)
    t = np.arange(40_000) * 1e-3
    rows = rows_of(t, np.cumsum(rng.normal(size=len(t))), np.zeros(len(t), dtype=bool), rng)
    kept = Overview(500)
    for first in range(0, len(t), 7001):
        piece = rows.part(slice(first, first + 7001))
        chosen = kept.choose(piece)
        kept.take(piece, chosen, piece.t[chosen])
    found, numbers = kept.all()
    assert 120 <= len(found.t) <= 500
    np.testing.assert_array_equal(numbers, found.t)
    assert (np.diff(found.t) > 0).all()
    stride = len(t) // 120 * 2
    for first in range(0, len(t), stride):  # any stretch of some runs has its extremes to within one run
        assert found.K.max() == rows.K.max() and found.K.min() == rows.K.min() and found.norm.max() == rows.norm.max()
        assert len(found.t[(found.t >= t[first]) & (found.t < t[first] + stride * 1e-3)]) >= 2


def test_telling_states_of_runs():
    run = np.array([0, 0, 0, 1, 1, 1, 1])
    K = np.array([2.0, 3.0, 1.0, 5.0, 4.0, 6.0, 5.5])
    norm = np.array([0.0, np.nan, 0.0, 0.0, 0.0, 0.0, 9.0])
    np.testing.assert_array_equal(telling(run, K, norm), [0, 1, 2, 3, 4, 5, 6])
    np.testing.assert_array_equal(telling(np.zeros(4, dtype=int), np.arange(4.0), np.zeros(4)), [0, 3])


@pytest.mark.parametrize("size", [700, 2500, 20_000])
def test_all_states_around_contacts_are_kept(size):
    """However the recording is cut into pieces; of a long contact those about its beginning and its end."""
    rng = np.random.default_rng(4)
    t = np.arange(20_000) * 1e-3
    collision = ((t >= 5.0) & (t < 5.2)) | ((t >= 6.5) & (t < 6.6)) | (t >= 13.0) & (t < 19.0)
    rows, contacts, runs = rows_of(t, t, collision, rng), Contacts(), []
    for first in range(0, len(t), size):
        runs += contacts.take(rows.part(slice(first, first + size)))
    runs += contacts.end()
    edges = [5.0, 5.2, 6.5, 6.6, 13.0, 19.0]
    expected = t[np.any([np.abs(t - edge) <= AROUND + 1e-9 for edge in edges], axis=0)]
    np.testing.assert_allclose(np.concatenate([run.t for run in runs]), expected)
    assert len(runs) == 3


def test_mean_powers_are_works_by_time():
    """Of K = t² and a work of 3t² the powers are 2t and 6t; nothing is known over a gap, nor where an effort is missing."""
    rng = np.random.default_rng(5)
    t = np.concatenate([np.arange(1000) * 1e-3, 5.0 + np.arange(1000) * 1e-3])
    powers = np.repeat(6.0 * t[:, None], 4, axis=1)
    powers[1500:1600, 0] = np.nan
    work, unknown = Works().take(t, powers)
    rows = rows_of(t, t * t, np.zeros(len(t), dtype=bool), rng)._replace(work=work, unknown=unknown)
    found = mean_powers(rows)
    inner = np.r_[50:900, 1050:1450, 1650:1950]
    np.testing.assert_allclose(found[inner, 4], 2.0 * t[inner], rtol=1e-6)
    np.testing.assert_allclose(found[inner, 0], 6.0 * t[inner], rtol=1e-6)
    assert np.isnan(found[1510:1590, 0]).all()
    assert np.isfinite(found[1510:1590, 1]).all()
    assert np.isnan(found[995:1005]).all()


# --- How they are made small ---


def unpacked(packed, width):
    """Columns again, as the page has them."""
    planes = np.frombuffer(gzip.decompress(packed.data), np.uint8).reshape(width, 2, packed.rows).astype(np.int64)
    zigzag = (planes[:, 0] << 8) | planes[:, 1]
    difference = (zigzag >> 1) ^ -(zigzag & 1)
    columns = []
    for k, (low, step, order) in enumerate(packed.columns):
        whole = difference[k]
        for _ in range(int(order)):
            whole = np.cumsum(whole)
        whole &= 0xFFFF
        columns.append(np.where(whole > 0, low + (whole - 1) * step, np.nan))
    return np.array(columns).T


def test_packed_numbers_come_back():
    rng = np.random.default_rng(6)
    t = np.linspace(0.0, 9.0, 3000)
    numbers = np.stack(
        [np.sin(t), 1e-9 * rng.normal(size=3000), rng.integers(0, 127, 3000), np.full(3000, 2.5)], axis=1
    )
    numbers[100:200, 0], numbers[5, 1] = np.nan, np.inf
    found = unpacked(pack(numbers), 4)
    numbers[5, 1] = np.nan
    spans = np.nanmax(numbers, axis=0) - np.nanmin(numbers, axis=0)
    np.testing.assert_array_equal(np.isnan(found), np.isnan(numbers))
    assert (np.nanmax(np.abs(found - numbers), axis=0) <= 0.51 * spans / LEVELS).all()
    np.testing.assert_array_equal(found[:, 2], numbers[:, 2])


def test_noise_is_not_kept():
    """Steps are a third of its standard deviation, for a smooth motion below it as for a jump; the error stays below that."""
    rng = np.random.default_rng(10)
    t = np.linspace(0.0, 4.0, 4000)
    smooth = 30.0 * np.sin(3.0 * t) + 10.0 * (t > 2.0)
    packed = pack(np.stack([smooth + rng.normal(0.0, 0.1, len(t)), smooth], axis=1), 16_000, 1.0 / 3.0)
    assert packed.columns[0][1] == pytest.approx(0.1 / 3.0, rel=0.1)
    assert packed.columns[1][1] == pytest.approx(np.ptp(smooth) / 16_000)


def test_meshes_have_fewer_vertices_where_they_must():
    rng = np.random.default_rng(7)
    points = rng.normal(size=(3000, 3)).astype("<f4")
    faces = rng.integers(0, 3000, size=(9000, 3)).astype("<u4")
    data = np.array([3000, 9000], dtype="<u4").tobytes() + points.tobytes() + faces.tobytes()
    whole = len(pack_mesh(data))
    assert set(pack_meshes({"a": data, "b": data}, 10 * whole)) == {"a", "b"}
    thin = pack_meshes({"a": data, "b": data}, whole)
    assert 0 < sum(map(len, thin.values())) <= whole
    assert pack_meshes({"a": data}, 10) == {}


# --- The file ---


def watched(threshold):
    """Parameters of an observer that tells of contacts."""
    return [f"external_torque.threshold={threshold}", "external_torque.gain=25.0"]


@pytest.fixture(scope="module")
def simulated(tmp_path_factory):
    """A recording of a UR5 that swings in gravity, damped, and is pushed once; and alarms that see it."""
    folder = tmp_path_factory.mktemp("report")
    model = dd.load_urdf(str(find_urdf("ur5")))
    dyn = dd.DiagonalDynamics(model)
    t = np.arange(0.0, LENGTH, 1.0 / RATE)
    pace = 0.7 + 0.3 * np.arange(model.nv)
    q = 0.6 * np.sin(pace * t[:, None]) - np.array([0, 1.2, 0, 0, 0, 0])
    qd, qdd = 0.6 * pace * np.cos(pace * t[:, None]), -0.6 * pace**2 * np.sin(pace * t[:, None])
    tau = np.array([dyn.inverse_dynamics(*state) for state in zip(q, qd, qdd, strict=True)])
    tau[(t >= PUSHED[0]) & (t < PUSHED[1]), 1] -= 30.0
    names = [f"{what}_{name}" for what in ("q", "qd", "tau") for name in model.dof_names]
    table = np.column_stack([t, q, qd, tau])
    path = folder / "swing.csv"
    np.savetxt(path, table, delimiter=",", header=",".join(["t", *names]), comments="", fmt="%.17g")
    html, limits = folder / "report.html", folder / "limits.yaml"
    limits.write_text("regions: {nobody: {mass: 3.0, stiffness: 20000, force: 60}}", encoding="utf-8")
    arguments = [
        "analyse",
        str(path),
        "--urdf",
        "ur5",
        "--set",
        "external_torque.threshold=20",
        "external_torque.gain=25.0",
        f"contact.limits_file={limits}",
        "--quiet",
    ]
    assert main([*arguments, "--report", str(html), "--json", str(folder / "summary.json")]) in (0, 1)
    return html, t, q, qd, tau, model


@pytest.fixture(scope="module")
def chromium():
    with browser() as one:
        yield one


@pytest.fixture(scope="module")
def tab(chromium, simulated):
    one = Tab(chromium, (1280, 720))
    one.open(simulated[0].as_uri())
    yield one
    assert one.said == []
    assert one.asked <= {"file://", "data://", "blob://"}, "a report asked the network"
    assert one.ask("diag.errors") == []
    one.close()


def go(tab, t):
    """Show a moment; returns what is shown."""
    tab.until("diag.values")
    tab.ask(f"diag.go({t!r})")
    tab.drawn()
    return tab.ask("diag.values")


def test_numbers_in_the_page_are_those_of_the_recording(tab, simulated):
    """At moments in the overview and at full rate: to half a step of the packing, and the rounding of floats."""
    _, t, q, qd, tau, model = simulated
    batch = dd.DiagonalDynamics(model).evaluate_batch(q, qd, tau)
    columns = {
        "q": q,
        "qd": qd,
        "effort": tau,
        "nu": batch.nu,
        "coriolis": batch.coriolis,
        "D": batch.articulated_inertia,
    }
    columns["K"] = batch.kinetic_energy[:, None]
    for moment in (1.0, 3.3, 4.2, 9.7, 13.0):
        values = go(tab, moment)
        k = round(values["t"] * RATE)
        assert values["t"] == pytest.approx(t[k], abs=2e-6)
        for name, column in columns.items():
            spans = np.ptp(column, axis=0)
            assert (np.abs(values[name] - column[k]) <= spans / 16_000 + 1e-6 * np.abs(column).max() + 1e-9).all(), name


def test_ellipsoid_and_velocity_of_the_hand(tab, simulated):
    """J M⁻¹Jᵀ and J q̇ of the link that the page chooses; at full rate they are of every 20th state, and even in between."""
    _, _, q, qd, _, model = simulated
    dyn = dd.DiagonalDynamics(model)
    for moment in (1.0, 4.2, 13.0):
        values = go(tab, moment)
        k = round(values["t"] * RATE)
        factor = dyn.wrench_factor(q[k], "wrist_3_link", frame="world")
        mobility, twist = factor.T @ factor, dyn.link_velocity(q[k], qd[k], "wrist_3_link", frame="world")
        np.testing.assert_allclose(values["mobility"], mobility[np.triu_indices(6)], rtol=0, atol=1e-3 * mobility.max())
        np.testing.assert_allclose(values["twist"], twist, rtol=0, atol=2e-3 * np.abs(twist).max())
        tab.until("diag.marks && diag.marks.link === 'wrist_3_link'")
        speed = np.linalg.norm(twist[:3])
        u = twist[:3] / speed
        marks = tab.ask("diag.marks")
        assert marks["speed"] == pytest.approx(speed, rel=5e-3)
        assert marks["mass"] == pytest.approx(1.0 / (u @ mobility[:3, :3] @ u), rel=1e-2)
    tab.page.keyboard.press("e")
    tab.until("diag.marks === null")
    tab.page.keyboard.press("e")
    tab.until("diag.marks !== null")


def test_every_state_around_the_contact(tab):
    """Steps are a millisecond there, and coarser elsewhere if the recording is long."""
    contact = tab.ask(
        "diag.state.ready && JSON.parse(document.getElementById('report').textContent).summary.collisions"
    )
    assert contact
    assert PUSHED[0] < contact[0]["start"] < PUSHED[0] + 0.2
    go(tab, contact[0]["start"] - 1.5)
    at = tab.ask("diag.state.now")
    tab.page.keyboard.press("ArrowRight")
    tab.until(f"diag.state.now > {at!r}")
    assert tab.ask("diag.state.now") - at == pytest.approx(1.0 / RATE, abs=2e-6)


def test_tells_what_happened(tab, simulated):
    _, t, q, qd, tau, model = simulated
    batch = dd.DiagonalDynamics(model).evaluate_batch(q, qd, tau)
    at = t[int(np.argmax(batch.kinetic_energy))]
    words = tab.page.locator("#overall").inner_text()
    assert f"{at:.3f} s" in words
    assert "balance explains" in words
    assert "contact" in tab.page.locator("#contacts h2").inner_text()
    assert "1000 Hz" in tab.page.locator("#quality").inner_text()
    assert "external_torque.threshold" in tab.page.locator("#parameters").inner_text()
    tab.page.locator("#overall button").first.click()
    tab.until(f"Math.abs(diag.state.now - {at}) < 2e-3")
    tab.page.locator("#contacts button").first.click()
    tab.until("diag.state.window[1] - diag.state.window[0] < 6")
    tab.page.keyboard.press("0")
    tab.until(f"diag.state.window[1] - diag.state.window[0] > {LENGTH - 0.1}")


def test_tells_what_a_touch_would_have_cost(tab, simulated):
    """How long limits were exceeded and by which points, the worst moments, and what half of the mass would have said."""
    html, _, _, _, _, model = simulated
    contact = json.loads((html.parent / "summary.json").read_text(encoding="utf-8"))["contact"]
    worst = contact["worst"][0]
    words = " ".join(tab.page.locator("#touches").inner_text().split())
    assert 1.0 < contact["above"] < 10.0
    assert f"exceeded for {contact['above']:.2f} s of 14.0 s" in words
    assert f"{worst['at']:.3f} s" in words
    assert worst["point"] in words.replace("\u200b", "")
    assert f"{worst['speed']:.3g} m/s" in words
    half = mass_of_half(model)
    assert f"{half:.2f} kg: {0.5 * half * worst['speed'] ** 2:.3g} J" in words
    tab.page.locator("#touches button").first.click()
    tab.until(f"Math.abs(diag.state.now - {worst['at']}) < 2e-2")


def shown_contact(tab, t):
    """What the page shows of contact at a moment, once it does."""
    at = go(tab, t)["t"]
    tab.until(f"diag.contact.shown && Math.abs(diag.contact.shown.t - {at!r}) < 1e-9")
    return tab.ask("diag.contact")


def steps_of(html):
    """Half of the largest step by which a report's contact is packed: place, speed, and decimal logarithms of the rest."""
    told, _ = parts_of(html)
    steps = 0.51 * np.array([[step for _, step, _ in track["contact"]] for track in told["tracks"]]).max(axis=0)
    points = len(told["contact"])
    return steps[1:4].max(), *(steps[4 + points * k : 4 + points * (k + 1)].max() for k in range(3))


def require_contact(shown, c, half, steps):
    """Have what is shown be the library's contact of the state, to half a step of the packing and the rounding of floats."""
    place, speed, mass, allowed = steps
    assert max(place, speed) < 1e-4
    assert max(mass, allowed) < 3e-4
    points = shown["shown"]["points"]
    assert shown["shown"]["worst"] == c.worst
    assert shown["shown"]["half"] == pytest.approx(half)
    assert tuple(point["name"] for point in points) == c.names
    for k, point in enumerate(points):
        assert point["speed"] == pytest.approx(c.speed[k], rel=1e-6, abs=speed)
        assert point["mass"] == pytest.approx(c.reflected_mass[k], rel=2.4 * mass + 1e-6)
        if c.points.limited[k]:
            assert point["allowed"] == pytest.approx(c.allowed_speed[k], rel=2.4 * allowed + 1e-6)
            assert point["margin"] == pytest.approx(c.margin[k], abs=3e-4 * c.allowed_speed[k] + 2 * speed)
        else:
            assert point["allowed"] is point["margin"] is None
        largest = 2.4 * mass * c.energy[k] + 2.0 * c.reflected_mass[k] * max(c.speed[k], speed) * speed
        assert point["energy"] == pytest.approx(c.energy[k], rel=1e-6, abs=1.1 * largest)
    np.testing.assert_allclose(points[c.worst]["position"], c.position[c.worst], rtol=1e-6, atol=place)


def test_contact_is_that_of_the_state_that_is_seen(tab, simulated):
    """Of every point, in the overview and at full rate, and the card and the ball have it."""
    html, _, q, qd, _, model = simulated
    limits = dd.ContactLimits.load(html.parent / "limits.yaml")
    points = dd.ContactPoints(model, dd.link_geometry(model, find_urdf("ur5")).points, limits, "limit")
    dyn, half = dd.DiagonalDynamics(model), mass_of_half(model)
    worst = set()
    for moment in (1.0, 3.1, 3.117, 4.2, 4.2013, 9.7, 13.0):
        shown = shown_contact(tab, moment)
        k = round(shown["shown"]["t"] * RATE)
        c = dyn.contact(q[k], qd[k], points)
        require_contact(shown, c, half, steps_of(html))
        np.testing.assert_allclose(shown["drawn"], c.position[c.worst], rtol=1e-6, atol=steps_of(html)[0])
        worst.add(int(c.worst))
        first = tab.page.locator(".touch tbody tr").first
        k = c.names.index(first.get_attribute("title"))
        assert c.margin[k] == pytest.approx(c.margin.min(), abs=1e-3)
        numbers = [number_of(text) for text in first.inner_text().split()[1:]]
        told = [c.margin[k], c.speed[k], c.reflected_mass[k], c.energy[k], 0.5 * half * c.speed[k] ** 2]
        np.testing.assert_allclose(numbers, told, rtol=8e-3, atol=1e-3)
    assert len(worst) > 1
    assert "then" in tab.page.locator("#contact h2").inner_text()
    assert tab.page.locator(".touch tr.above").count() == int((c.margin < 0).sum())


def number_of(text):
    return float(text.replace("−", "-"))


def test_numbers_of_contact_are_among_those_that_are_downloaded(tab, simulated):
    html, _, q, qd, _, model = simulated
    tab.page.locator("#contacts button").first.click()
    tab.until("diag.state.window[1] - diag.state.window[0] < 6")
    with tab.page.expect_download() as file:
        tab.page.keyboard.press("c")
    tab.page.keyboard.press("0")
    with open(file.value.path(), encoding="utf-8", newline="") as text:
        header, *rows = csv.reader(text)
    limits = dd.ContactLimits.load(html.parent / "limits.yaml")
    points = dd.ContactPoints(model, dd.link_geometry(model, find_urdf("ur5")).points, limits, "limit")
    assert len(rows) > 4.0 * RATE
    _, speed, mass, allowed = steps_of(html)
    which = np.array([round(float(row[0]) * RATE) for row in rows])
    c = dd.DiagonalDynamics(model).contact_batch(q[which], qd[which], points)
    assert [row[header.index("contact_worst")] for row in rows] == [c.names[k] for k in c.worst]
    wanted = {
        "contact_speed": (c.speed, 0.0, speed),
        "contact_mass": (c.reflected_mass, 2.4 * mass, 0.0),
        "contact_energy": (c.energy, 2.4 * mass, 10.0 * speed),
        "contact_allowed_speed": (c.allowed_speed, 2.4 * allowed, 0.0),
        "contact_margin": (c.margin, 0.0, 3e-4 * c.allowed_speed.max()),
    }
    for quantity, (column, relative, absolute) in wanted.items():
        for k, name in enumerate(c.names):
            at = header.index(f"{quantity}.{name}")
            seen = [float(row[at]) for row in rows]
            np.testing.assert_allclose(
                seen, column[:, k], rtol=relative + 1e-6, atol=absolute + 1e-12, err_msg=quantity
            )


def test_panels_of_text_say_that_there_is_more(tab):
    """A faded edge until one has scrolled to the end; plots stay within their panels."""
    assert tab.out_of_panels() == []
    text = tab.page.locator("#overall .text")
    tab.until("document.querySelector('#overall .text').classList.contains('more')")
    text.evaluate("(box) => box.scrollTo(0, box.scrollHeight)")
    tab.until("!document.querySelector('#overall .text').classList.contains('more')")
    parameters = tab.page.locator("#parameters")
    parameters.locator("summary").click()
    words = parameters.inner_text()
    assert not re.search(r"\b(True|False|None)\b|[\[\]']", words), words
    parameters.locator("summary").click()


def test_parameters_in_words():
    told = [output.in_words(value) for value in (True, False, [], ["a=1.5", "b=2"], [0.5, 1.0], "", "x", 25.0)]
    assert told == ["yes", "no", "none", "a=1.5, b=2", "0.5, 1.0", "none", "x", "25.0"]


def test_step_of_the_scrubber(tab):
    """At most 50 ms of script, the 3-D apart: the median of the least that each takes in five times."""
    steps = """async () => {
      const { first, last } = window.diag.state, out = [];
      for (let k = 0; k < 150; k++) {
        window.diag.go(first + ((last - first) * ((k % 30) + 0.5)) / 30);
        await new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)));
        out.push(window.diag.step);
      }
      return out;
    }"""
    assert np.median(np.min(np.reshape(tab.page.evaluate(steps), (5, 30)), axis=0)) < 50.0


def test_no_text_of_a_report_is_cut_off(tab):
    try:
        for width, height in ((360, 740), (1280, 720), (1920, 1080), (3840, 2160)):
            tab.page.set_viewport_size({"width": width, "height": height})
            assert tab.cut_off() == [], f"{width} x {height}"
    finally:
        tab.page.set_viewport_size({"width": 1280, "height": 720})


def test_report_of_real_arms(chromium, tmp_path):
    """Of the recording of a Panda without its hand: the explained share is that of the summary."""
    path = RECORDINGS / "panda" / "exciting_trajectory.csv.gz"
    if not path.exists():
        pytest.skip("../shared/recordings/panda is not there")
    html, summary = tmp_path / "panda.html", tmp_path / "summary.json"
    robot = ["--urdf", "panda", "--set", "locked_joints=panda_finger_joint1=0"]
    main(["analyse", str(path), *robot, "--end", "6", "--quiet", "--report", str(html), "--json", str(summary)])
    told = json.loads(summary.read_text(encoding="utf-8"))
    tab = Tab(chromium, (1280, 720), "light")
    try:
        tab.open(html.as_uri())
        words = tab.page.locator("#overall").inner_text()
        explained = 100 * told["explained"]
        assert f"{explained:.1f} %" in words
        assert f"{told['kinetic_energy']['max']:.3g} J" in words
        assert tab.ask("diag.missing") == 0
        assert tab.said == []
        assert html.stat().st_size < 5e6
    finally:
        tab.close()


# --- What is not known ---


@pytest.mark.parametrize(
    "given, efforts, missing, words",
    [
        ([], True, ["external_torque.gain", "external_torque.threshold"], ["external_torque.gain and", "calibrate"]),
        (["external_torque.threshold=20"], True, ["external_torque.gain"], ["gain is not set, without", "calibrate"]),
        (["external_torque.gain=25.0"], True, ["external_torque.threshold"], ["threshold is not set", "calibrate"]),
        (watched(20), False, [], ["no efforts"]),
    ],
    ids=["neither", "no gain", "no threshold", "no efforts"],
)
def test_contacts_of_which_nothing_is_known(chromium, simulated, tmp_path, capsys, given, efforts, missing, words):
    """Summary, text and page say so, and which parameter is missing; no word of there having been none."""
    _, t, q, qd, tau, _ = simulated
    path, report, told = tmp_path / "part.npz", tmp_path / "part.html", tmp_path / "part.json"
    part = slice(3500, 5000)  # the push is in it
    columns = {"t": t[part], "q": q[part], "qd": qd[part]} | ({"tau": tau[part]} if efforts else {})
    np.savez(path, **columns)
    arguments = ["--urdf", "ur5", "--report", str(report), "--json", str(told)]
    assert main(["analyse", str(path), *arguments, *(["--set", *given] if given else [])]) in (0, 1)
    summary = json.loads(told.read_text(encoding="utf-8"))
    observer = summary["observer"]
    assert observer["missing"] == missing
    assert observer["observed"] == (len(t[part]) - 1 if efforts else 0)
    assert summary["collisions"] == []
    said = " ".join(capsys.readouterr().out.split())
    assert "0 collisions" not in said
    tab = Tab(chromium, (1280, 720), "light")
    try:
        tab.open(report.as_uri())
        assert "nothing known" in tab.page.locator("#contacts h2").inner_text()
        seen = " ".join(tab.page.locator("#contacts").inner_text().replace("\u200b", "").split())
        for text in (said, seen):
            assert "Nothing is known of contacts" in text
            assert all(word in text for word in words), text
        assert tab.cut_off() == []
    finally:
        tab.close()


def test_states_of_which_the_observer_has_no_result_are_counted(simulated, tmp_path):
    """Contacts are told of the others, and of how many nothing is known."""
    _, t, q, qd, tau, _ = simulated
    part = slice(3500, 5500)
    missing = tau[part].copy()
    missing[1500:1700] = np.nan
    path, told = tmp_path / "gap.npz", tmp_path / "gap.json"
    np.savez(path, t=t[part], q=q[part], qd=qd[part], tau=missing)
    assert main(["analyse", str(path), "--urdf", "ur5", "--quiet", "--json", str(told), "--set", *watched(20)]) in (
        0,
        1,
    )
    summary = json.loads(told.read_text(encoding="utf-8"))
    unknown = summary["states"] - summary["observer"]["observed"]
    assert 201 <= unknown <= 202
    assert f"Of {unknown} of 2000 states nothing is known" in summary["observer"]["says"]
    assert len(summary["collisions"]) == 1
    assert main(["analyse", str(path), "--urdf", "ur5", "--quiet", "--json", str(told)]) in (0, 1)
    says = json.loads(told.read_text(encoding="utf-8"))["observer"]["says"]
    assert says.startswith("Nothing is known of contacts")  # that of some states nothing is known goes without saying
    assert "nothing is known" not in says


def test_the_gain_that_is_given_is_that_of_a_threshold(simulated, tmp_path):
    """By --gain as by the parameter; where both are given the parameter counts."""
    _, t, q, qd, tau, _ = simulated
    part = slice(3500, 5500)
    path, told = tmp_path / "push.npz", tmp_path / "push.json"
    np.savez(path, t=t[part], q=q[part], qd=qd[part], tau=tau[part])
    for options, gain in (([], 50.0), (["external_torque.gain=0.0"], 50.0), (["external_torque.gain=30.0"], 30.0)):
        given = ["--gain", "50", "--set", "external_torque.threshold=20.0", *options]
        assert main(["analyse", str(path), "--urdf", "ur5", "--quiet", "--json", str(told), *given]) in (0, 1)
        summary = json.loads(told.read_text(encoding="utf-8"))
        assert summary["observer"]["gain"] == gain
        assert summary["observer"]["missing"] == []
        assert len(summary["collisions"]) == 1


# --- Contact of other robots ---


def test_without_limits_there_is_no_margin_and_at_rest_no_worst_point(chromium, tmp_path):
    """The card is there all the same: the worst is the point with most energy, and there is no ball while nothing moves."""
    model = dd.load_urdf(str(find_urdf("ur5")))
    path, html = tmp_path / "swing.npz", tmp_path / "swing.html"
    columns = motion(model, 4.0)
    still = columns["t"] < 1.0
    columns["q"][still], columns["qd"][still] = columns["q"][still][0], 0.0
    np.savez(path, **columns)
    assert main(["analyse", str(path), "--urdf", "ur5", "--quiet", "--report", str(html)]) in (0, 1)
    told, _ = parts_of(html)
    assert len(told["tracks"]) == 1
    assert told["summary"]["contact"] is None
    points = dd.ContactPoints(model, dd.link_geometry(model, find_urdf("ur5")).points)
    dyn = dd.DiagonalDynamics(model)
    tab = Tab(chromium, (1280, 720), "dark")
    try:
        tab.open(html.as_uri())
        for moment in (1.7, 3.2):
            shown = shown_contact(tab, moment)["shown"]
            k = round(shown["t"] * RATE)
            c = dyn.contact(columns["q"][k], columns["qd"][k], points)
            assert shown["worst"] == c.worst
            assert all(point["margin"] is point["allowed"] is None for point in shown["points"])
            words = tab.page.locator("#contact p").inner_text()
            assert f"most energy: {c.names[c.worst]}" in words
            assert "no limits" in words
        assert "margin" not in tab.page.locator("#contact thead").inner_text()
        assert tab.cut_off() == []
        rest = shown_contact(tab, 0.5)
        assert rest["drawn"] is None
        assert rest["shown"]["worst"] == -1
        assert [point["mass"] for point in rest["shown"]["points"]] == [0] * len(points)
        assert "at rest" in tab.page.locator("#contact p").inner_text()
        assert tab.said == []
    finally:
        tab.close()


def test_a_model_that_was_made_before_has_no_contact(simulated, tmp_path):
    """There is no description in which points could be found: the report is made all the same."""
    html = tmp_path / "made.html"
    reading = Reading(simulated[0].parent / "swing.csv", simulated[5], end=2.0)
    analysis, report = Analysis(reading), output.ReportOutput(html, reading)
    analysis.run([report])
    report.close(summary_of(analysis.outcome) | {"recording": "swing.csv"})
    told, _ = parts_of(html)
    assert told["contact"] == []
    assert all("contact" not in track for track in told["tracks"])


def test_the_ball_goes_with_a_floating_base(chromium, tmp_path):
    """The worst point is told in the root link's axes, and drawn where these are at that moment, not at the one before."""
    model = dd.load_robot("panda", floating_base=True)
    driver, count = Driver(dd.load_robot("panda"), 1), 1000
    joints, bases = [], []
    for k in range(count):
        now = START + k * 2 * 10**6
        turn = 0.5 * 1.3 * k / count
        pose = (4.0 * k / count, np.sin(5.0 * k / count), 0.8, 0.0, 0.0, np.sin(turn), np.cos(turn))
        bases.append((now, odometry(now, model.root_link, pose, (1.2, 0.3, 0.0, 0.0, 0.0, 0.4))))
        joints.append((driver.good(now), now))
    path, html = write_floating(tmp_path / "base.mcap", joints, bases), tmp_path / "base.html"
    assert main(
        ["analyse", str(path), "--urdf", "panda", "--quiet", "--set", "floating_base=true", "--report", str(html)]
    ) in (0, 1)
    rec = dd.read_recording(path, str(find_urdf("panda")), parameters={"floating_base": True})
    dyn = dd.DiagonalDynamics(rec.model)
    points = dd.ContactPoints(rec.model, dd.link_geometry(rec.model, find_urdf("panda")).points)
    tab = Tab(chromium, (1280, 720), "light")
    try:
        tab.open(html.as_uri())
        for moment in (0.2, 1.8, 0.4, 1.1):
            shown = shown_contact(tab, moment)
            k = int(np.argmin(np.abs(rec.t - rec.t[0] - shown["shown"]["t"])))
            c = dyn.contact(rec.q[k], rec.qd[k], points)
            assert shown["shown"]["worst"] == c.worst
            root = dyn.placement(rec.q[k], rec.model.root_link)
            place = root[:3, :3] @ c.position[c.worst] + root[:3, 3]
            np.testing.assert_allclose(shown["drawn"], place, atol=3e-4)
        assert tab.said == []
    finally:
        tab.close()


# --- Its size, and what goes wrong ---


def test_an_hour_takes_less_than_15_mb(tmp_path):
    """Of a noisy minute at 1 kHz with contacts: what each kept state takes, times as many as an hour keeps, and all bounds.

    The overview has a largest number of states however long a recording is, and states at full rate have a largest size.
    """
    model = dd.load_urdf(str(find_urdf("panda")), locked_joints={"panda_finger_joint1": 0.0})
    path, html = tmp_path / "minute.npz", tmp_path / "minute.html"
    np.savez(path, **motion(model, 60.0, contacts=(20.0, 40.0)))
    robot = ["--urdf", "panda", "--set", "locked_joints=panda_finger_joint1=0", *watched(30)]
    assert main(["analyse", str(path), *robot, "--quiet", "--report", str(html)]) in (0, 1)
    told, blocks = parts_of(html)
    size = html.stat().st_size
    width = sum(field["size"] for field in told["layout"]["fields"]) + len(told["tracks"][0]["contact"])
    most = output.OVERVIEW // (2 * width)
    kept, *full = told["tracks"]
    assert most / 5 < kept["rows"] <= most
    assert len(full) == 2
    assert all(4.0 * RATE < track["rows"] < 6.0 * RATE for track in full)
    takes = [sum(len(blocks[k]) for k in track["blocks"]) for track in told["tracks"]]
    hour = size - sum(takes) + takes[0] * most / kept["rows"]
    assert hour + 25 * np.mean(takes[1:]) < LARGEST  # there is room for 25 of them


def test_contacts_have_the_room_that_is_left(tmp_path, monkeypatch):
    """Where not all have room, the strongest are kept at full rate, and the report says how many are not."""
    model = dd.load_urdf(str(find_urdf("ur5")))
    path, html = tmp_path / "pushed.npz", tmp_path / "pushed.html"
    columns = motion(model, 14.0, contacts=(2.0, 8.0))
    columns["tau"][(columns["t"] >= 8.0) & (columns["t"] < 8.3), 1] -= 60.0
    np.savez(path, **columns)
    robot = ["--urdf", "ur5", "--quiet", "--set", *watched(25)]
    assert main(["analyse", str(path), *robot, "--report", str(html)]) in (0, 1)
    told, blocks = parts_of(html)
    assert len(told["tracks"]) == 3
    one = sum(len(blocks[k]) for k in told["tracks"][1]["blocks"])
    monkeypatch.setattr(output, "LARGEST", html.stat().st_size - one // 2)
    assert main(["analyse", str(path), *robot, "--report", str(html)]) in (0, 1)
    told, _ = parts_of(html)
    assert len(told["tracks"]) == 2
    assert told["without_full_rate"] == 1
    assert html.stat().st_size < output.LARGEST + one // 2


def motion(model, length, contacts=()):
    """A noisy recording of a robot that swings, pushed for 0.3 s at some times."""
    t = np.arange(0.0, length, 1.0 / RATE)
    rng = np.random.default_rng(9)
    middle, pace = 0.5 * (model.lower + model.upper), 0.6 + 0.21 * np.arange(model.nv)
    phase = pace * t[:, None]
    q, qd, qdd = middle + 0.4 * np.sin(phase), 0.4 * pace * np.cos(phase), -0.4 * pace**2 * np.sin(phase)
    dyn = dd.DiagonalDynamics(model)
    tau = dyn.tau_from_epsilon_batch(q, _epsilon(dyn, q, qd, qdd))
    for begin in contacts:
        tau[(t >= begin) & (t < begin + 0.3), 1] -= 40.0
    noisy = {"q": (q, 1e-5), "qd": (qd, 2e-3), "tau": (tau, 0.1)}
    return {"t": t} | {name: column + rng.normal(0.0, size, q.shape) for name, (column, size) in noisy.items()}


def _epsilon(dyn, q, qd, qdd):
    """Working moments of a motion: dν/dt + C + ε_g, with dν/dt by central differences."""
    s = dyn.evaluate_batch(q, qd)
    return np.gradient(s.nu, 1.0 / RATE, axis=0) + s.coriolis + s.gravity


def parts_of(html):
    """What a report tells, and its blocks as text."""
    text = html.read_text(encoding="utf-8")
    told = re.search(r'<script type="application/json" id="report">(.*?)</script>', text, re.DOTALL)
    blocks = re.findall(r'<script type="text/plain" id="block-\d+">(.*?)</script>', text)
    return json.loads(told[1]), blocks


def test_refuses_to_write_over_what_is_read(tmp_path, simulated, capsys):
    csv = simulated[0].parent / "swing.csv"
    assert main(["analyse", str(csv), "--urdf", "ur5", "--report", str(csv)]) == 2
    assert "is read" in capsys.readouterr().err
    assert main(["analyse", str(csv), "--urdf", "ur5", "--report", str(tmp_path / "no" / "r.html")]) == 2
    assert "there is no folder" in capsys.readouterr().err
    with pytest.raises(InputError, match="folder"):
        output.ReportOutput(tmp_path, Reading(csv, simulated[5]))


def test_without_a_page_it_says_so(tmp_path):
    with pytest.raises(InputError, match="make page"):
        write_report(tmp_path / "r.html", {}, [], {}, static=tmp_path)
