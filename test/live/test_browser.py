# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The page in Chromium. One smoke test is of the gate; the functions of the page have tests of
their own in web/test.
"""

import csv
import threading
import time

import numpy as np
import pytest

import diag_dynamics as dd
import page_fixture
import recorded_arm
from browser import Tab, browser
from diag_dynamics.cli.main import main
from diag_dynamics.description.catalog import find_urdf
from diag_dynamics.page.frames import States
from diag_dynamics.page.meshes import MeshLibrary
from diag_dynamics.page.scene import mesh_folders, scene_of
from diag_dynamics.page.server import PageServer
from diag_dynamics.page.stream import Received, RobotStream
from moving_robot import MovingRobot
from recorded_arm import ARM, WATCHED, Recording
from robots import description, joint, link

pytestmark = pytest.mark.browser


@pytest.fixture(scope="module")
def chromium():
    with browser() as browser_:
        yield browser_


def still(dynamics):
    """Return the state of page_fixture with the present time."""
    state = page_fixture.Q, page_fixture.QD, page_fixture.EFFORT
    observed = {
        "residual": np.zeros((1, 2)),
        "external_torque": np.zeros((1, 2)),
        "norm": np.zeros(1),
    }
    return Received(
        States.of(time.time(), *state, dynamics.evaluate(*state), **observed), time.monotonic()
    )


@pytest.fixture
def serve():
    """Serve robots in this process; returns a function that takes their streams and returns the
    server.
    """
    servers = []

    def start(*streams):
        servers.append(PageServer(lambda: streams))
        servers[-1].start()
        return servers[-1]

    yield start
    for server in servers:
        server.stop()


def test_the_page_shows_the_kinetic_energy_of_the_state(chromium, serve):
    """The page opens, its console says nothing, and K is 6.5 J."""
    model = dd.load_urdf(page_fixture.ARM)
    stream = RobotStream("/arm", still)
    stream.set_robot(dd.DiagonalDynamics(model), scene_of(model, page_fixture.ARM))
    address = serve(stream).address
    with Tab(chromium, (640, 480)) as tab:
        tab.open(address)
        tab.until("document.querySelector('.headline b').textContent === '6.50 J'")
        assert tab.said == []
        assert tab.asked == {address.rstrip("/")}


# --- The full tier: numbers, keys, states and layout ---

RATE, SIZES = 100.0, ((360, 740), (1280, 720), (1920, 1080), (3840, 2160))


class Robot(MovingRobot):
    """A moving robot that can stop sending, and whose states can be flagged."""

    def __init__(self, model, rate=RATE):
        super().__init__(model, rate)
        self.silent = threading.Event()
        self.doubtful = threading.Event()

    def at(self, stamp):
        """Return the state of a stamp."""
        return self.state(stamp - self._first_stamp)

    def take(self, dynamics):
        received = None if self.silent.is_set() else super().take(dynamics)
        if received is None or not self.doubtful.is_set():
            return received
        unknown = {"residual": np.nan, "external_torque": np.nan, "norm": np.array([np.nan])}
        return received._replace(
            states=received.states._replace(velocity_estimated=True, **unknown)
        )


def shown(urdf, name):
    """Return a robot and its stream."""
    robot = Robot(dd.load_urdf(urdf, massless="lock"))
    stream = RobotStream(name, robot.take)
    meshes = MeshLibrary(mesh_folders(urdf) if not urdf.startswith("<") else ())
    stream.set_robot(dd.DiagonalDynamics(robot.model), scene_of(robot.model, urdf, meshes), meshes)
    stream.set_diagnostics([status(1, "joint states", "a gap of 0.2 s")])
    return robot, stream


def status(level, name, message):
    return {
        "level": level,
        "name": f"/arm/diag_dynamics: {name}",
        "message": message,
        "values": {"gaps": 1},
    }


def chain(names, shape='<visual><geometry><sphere radius="0.03"/></geometry></visual>', limit=0.2):
    """Return a URDF of links in a row with these joints."""
    inertia = (0.3, (0.0, 0.0, 0.05), (1e-3, 0.0, 0.0, 1e-3, 0.0, 1e-3))
    links = [
        link(f"link{k}", *inertia).replace("</link>", f"{shape}</link>")
        for k in range(len(names) + 1)
    ]
    joints = [
        joint(name, "revolute", f"link{k}", f"link{k + 1}", (k % 2, 1 - k % 2, 0), (0, 0, 0.1))
        for k, name in enumerate(names)
    ]
    text = description("chain", *links, *joints)
    return text.replace('lower="-10"', f'lower="-{limit}"').replace(
        'upper="10"', f'upper="{limit}"'
    )


def read_number(text):
    """Return a number of a text of the page."""
    return float(text.replace("−", "-"))


def rows_of(tab):
    """Return the rows of the CSV that the key C downloads."""
    with tab.page.expect_download() as file:
        tab.page.keyboard.press("c")
    with open(file.value.path(), encoding="utf-8", newline="") as rows:
        return list(csv.DictReader(rows))


@pytest.fixture(scope="module")
def panda():
    return shown(str(find_urdf("panda")), "/arm")


@pytest.fixture(scope="module")
def opened(chromium, panda):
    """Share a page between tests. Its console stays empty, and its requests go to its server."""
    streams = [panda[1], shown(str(find_urdf("ur5")), "/other")[1]]
    server = PageServer(lambda: streams)
    server.start()
    with Tab(chromium) as tab:
        tab.open(f"{server.address}#robot=/arm&cards=dynamics")
        yield tab
        assert (tab.said, tab.ask("diag.errors")) == ([], [])
        assert tab.asked <= {server.address.rstrip("/"), "data://", "blob://"}
    server.stop()


@pytest.fixture
def live(opened):
    """Return the page in its initial state."""
    for key in ("Escape", "l", "1"):
        opened.page.keyboard.press(key)
    opened.page.mouse.move(5, 5)
    opened.until(
        "diag.state.word === 'Live' && !diag.state.paused && diag.state.namespace === '/arm'"
    )
    return opened


def paused(tab, robot):
    """Stop the page; return what it shows, the state at that time, and its evaluation."""
    tab.until(f"diag.values.t > {tab.ask('diag.values.t')!r} + 0.5")
    tab.page.keyboard.press(" ")
    tab.until("diag.state.paused && diag.values.t === diag.state.now")
    tab.drawn()
    values = tab.ask("diag.values")
    state = robot.at(values["t"])
    return values, state, dd.DiagonalDynamics(robot.model).evaluate(*state[:3])


@pytest.mark.full
def test_numbers_are_those_of_the_state(live, panda):
    """Compare frames, table and CSV with an evaluation at the time that the page shows."""
    robot, _ = panda
    names = robot.model.dof_names
    dyn = dd.DiagonalDynamics(robot.model)
    values, (q, qd, tau, external), s = paused(live, robot)
    expected = {
        "q": q,
        "qd": qd,
        "effort": tau,
        "nu": s.nu,
        "coriolis": s.coriolis,
        "gravity": s.gravity,
        "D": s.articulated_inertia,
        "K": [s.kinetic_energy],
        "link_energy": s.link_energy,
        "external_torque": external,
        "gravity_torque": dyn.gravity_torque(q),
    }
    for name, wanted in expected.items():
        scale = max(np.abs(wanted).max(), 1e-3)
        np.testing.assert_allclose(values[name], wanted, rtol=1e-4, atol=1e-4 * scale, err_msg=name)
    rows = live.page.locator(".joints tbody tr").all_inner_texts()
    np.testing.assert_allclose(
        [read_number(row.split()[1]) for row in rows], s.energy_share, rtol=0.01, atol=1e-3
    )
    last = rows_of(live)[-1]
    assert float(last["t [s]"]) == values["t"]
    np.testing.assert_allclose(
        [float(last[f"nu.{name}"]) for name in names], values["nu"], rtol=1e-6
    )


@pytest.mark.full
def test_doubts_silence_diagnostics_and_another_robot(live, panda):
    robot, _ = panda
    live.until("document.querySelector('.diagnostics').innerText.includes('a gap of 0.2 s')")
    robot.doubtful.set()
    live.until("diag.state.notes.includes('velocities estimated') && diag.state.level === 'warn'")
    live.until(
        "[...document.querySelectorAll('.joints td:last-child b')].every((b) => "
        "b.textContent === '–')"
    )
    robot.doubtful.clear()
    robot.silent.set()
    live.until(
        "diag.state.word === 'Stale' && document.querySelector('.stage').classList.contains('dim')"
    )
    robot.silent.clear()
    live.until("diag.state.word === 'Live' && !diag.state.notes.includes('velocities estimated')")
    for name, rows in (("/other", 6), ("/arm", robot.model.nv)):
        live.page.keyboard.press("r")
        live.until(f"diag.state.namespace === '{name}' && diag.state.ready")
        live.until(f"document.querySelectorAll('.joints tbody tr').length === {rows}")


PRESETS = "monitoring", "contact", "dynamics"
VISIBLE = (
    "[...document.querySelectorAll('.stage, .tablebox, .card')].filter((one) => one.offsetParent)"
)
PLOT_FRACTIONS = """[...document.querySelectorAll('.plot')].filter((one) => one.offsetParent)
  .map((one) => one.clientHeight / one.closest('.card').clientHeight)"""
LETTERS = """Math.min(...[...document.querySelectorAll('body *')]
  .filter((one) => one.offsetParent &&
  [...one.childNodes].some((node) => node.nodeType === Node.TEXT_NODE && node.data.trim()))
  .map((one) => parseFloat(getComputedStyle(one).fontSize)))"""


def show_cards(tab, cards):
    """Show the cards of a preset."""
    tab.ask(f"location.hash = 'robot=/arm&cards={cards}'")
    tab.drawn()


@pytest.mark.full
def test_six_cards_at_first_with_readable_letters(chromium, panda):
    server = PageServer(lambda: [panda[1]])
    server.start()
    with Tab(chromium, (1440, 900), "light") as tab:
        tab.open(server.address)
        tab.drawn()
        names = tab.ask(f"{VISIBLE}.map((one) => one.id || one.className)")
        expected = [
            "stage",
            "tablebox",
            "plot-energy",
            "plot-external",
            "collisions",
            "diagnostics",
        ]
        assert names == expected
        for (width, height), pixels in {(1440, 900): 12, (1280, 720): 12, (2560, 1440): 14}.items():
            tab.page.set_viewport_size({"width": width, "height": height})
            for cards in PRESETS:
                show_cards(tab, cards)
                tab.until(f"Math.min(...{PLOT_FRACTIONS}) >= 0.6")
                assert tab.ask(LETTERS) >= pixels, (width, cards)
        tab.page.locator("button", has_text="Cards").click()
        tab.page.locator(".menu button", has_text="contact").click()
        tab.page.locator(".menu input[name=power]").check()
        tab.until("location.hash.includes('cards=limits,contact-limits')")
        assert "plot-power" in tab.ask(f"{VISIBLE}.map((one) => one.id)")
        tab.page.locator(".menu button", has_text="monitoring").click()
        assert tab.ask(f"{VISIBLE}.map((one) => one.id || one.className)") == expected
        assert tab.said == []
    server.stop()


@pytest.mark.full
def test_no_text_is_cut_off(live):
    for width, height in (*SIZES, (1280, 720)):
        live.page.set_viewport_size({"width": width, "height": height})
        live.page.keyboard.press("Escape")
        for cards in PRESETS:
            show_cards(live, cards)
            assert live.cut_off() == [], (width, height, cards)
        live.page.keyboard.press("j")
        live.until("!document.querySelector('.details').hidden")
        assert live.cut_off() == [], (width, height, "with details")
        below = (
            "(({ scrollHeight, clientHeight }) => scrollHeight - "
            "clientHeight)(document.querySelector('.details'))"
        )
        assert live.ask(below) <= 1, (width, height, "details that scroll")


@pytest.mark.full
def test_sixty_joints_and_names_that_are_html(chromium, serve):
    """A row for each joint; HTML in a name is text."""
    hostile = "&lt;img src=x onerror=alert(1)&gt;"
    _, stream = shown(
        chain([hostile, *(f"a_long_name_of_joint_{k}" for k in range(59))]), "/<b>long"
    )
    with Tab(chromium, (1000, 700), "light") as tab:
        tab.open(serve(stream).address)
        tab.until("document.querySelectorAll('.joints tbody tr').length === 60")
        tab.page.keyboard.press("j")  # the joint with that name
        tab.until("document.querySelector('.details h2').textContent.includes('<img src=x')")
        assert tab.ask("document.querySelectorAll('img').length") == 0
        assert tab.cut_off() == []
        assert tab.said == []


@pytest.mark.full
def test_names_and_status_on_a_phone(chromium, serve):
    """Joints have one line each; the worst status is whole."""
    _, stream = shown(chain(["root_joint/v_x", "arm_left_1_joint"]), "/arm")
    message = "all efforts are commands, but gravity requires others: the brakes hold the robot"
    stream.set_diagnostics([status(1, "efforts", message)])
    with Tab(chromium, (390, 844), "light") as tab:
        tab.open(serve(stream).address)
        tab.until(f"document.querySelector('.worst').textContent === 'efforts: {message}'")
        lines = tab.ask(
            "[...document.querySelectorAll('.joints tbody span')].map((name) => "
            "Math.round(name.clientHeight / parseFloat(getComputedStyle(name).lineHeight)))"
        )
        assert lines == [1, 1]
        assert tab.cut_off() == []


# --- Reports ---


def show_moment(tab, t):
    """Go to a moment. Return the values of its state and the drawn point of contact."""
    tab.until("diag.values")
    tab.ask(f"diag.go({t!r})")
    tab.until("diag.values.t === diag.state.now || Math.abs(diag.values.t - diag.state.now) < 0.1")
    tab.drawn()
    return tab.ask("diag.values"), tab.ask("diag.contact")


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    return Recording(tmp_path_factory.mktemp("report"))


@pytest.mark.full
def test_a_report_shows_the_recording(chromium, recording):
    """Numbers and contact of moments, words, buttons and panels; without a network."""
    options = [
        "--quiet",
        "--set",
        *WATCHED,
        f"contact_limits.file={recording.folder / 'limits.yaml'}",
    ]
    html, summary = recording.analyse("page", *options, **recording.columns())
    dyn = recording.dyn
    model = recording.model
    limits = dd.ContactLimits.load(recording.folder / "limits.yaml")
    points = dd.ContactPoints(model, dd.link_geometry(model, ARM).points, limits, "limit")
    with Tab(chromium) as tab:
        tab.open(f"{html.as_uri()}#cards=monitoring,parameters")
        for moment in (0.5, 2.1, 2.113, 6.7):
            values, place = show_moment(tab, moment)
            k = round(values["t"] * recorded_arm.RATE)
            s = dyn.evaluate(recording.q[k], recording.qd[k])
            c = dyn.contact_limits(recording.q[k], recording.qd[k], points)
            np.testing.assert_allclose(values["K"][0], s.kinetic_energy, rtol=2e-3)
            assert values["contact_limits_worst"] == [c.worst]
            np.testing.assert_allclose(values["contact_limits_speed"], c.speed, atol=1e-4)
            np.testing.assert_allclose(place, c.position[c.worst], atol=1e-3)
        for name, text in (
            ("overall", f"{summary['kinetic_energy']['max']:.3f} J"),
            ("limits", f"{summary['contact_limits']['worst']['at']:.3f} s"),
            ("collisions", "1 collision"),
            ("parameters", "collision.threshold"),
        ):
            assert text in " ".join(tab.page.locator(f"#{name}").inner_text().split())
        tab.page.locator("#collisions .link").first.click()
        tab.until(
            "diag.state.window[1] - diag.state.window[0] < 6 && diag.values.t === diag.state.now"
        )
        assert tab.ask("diag.values.norm[0]") == pytest.approx(
            summary["collisions"][0]["norm"], rel=1e-3
        )
        for width, height in SIZES:
            tab.page.set_viewport_size({"width": width, "height": height})
            assert tab.cut_off() == [], (width, height)
        assert (tab.said, tab.ask("diag.errors"), tab.ask("diag.missing")) == ([], [], 0)
        assert tab.asked <= {"file://", "data://", "blob://"}
        tab.ask("diag.go(2.113)")
        tab.until("decodeURI(location.hash).includes(`t=${diag.state.now}`)")
        link = tab.ask("location.href")
        now = tab.ask("diag.state.now")
    with Tab(chromium) as tab:
        tab.open(link)
        tab.until(f"diag.state.now === {now!r}")
        assert tab.said == []


@pytest.mark.full
def test_an_identification_is_printed_whole(chromium, recording):
    """Its tables fit on A4 with margins of 1 cm."""
    t, q, qd, tau = recording.motion(())
    noise = np.random.default_rng(1).normal(size=(2, *q.shape))
    path, page = recording.folder / "free.npz", recording.folder / "identified.html"
    friction = 2.0 * qd + 3.0 * np.sign(qd) + 0.5
    np.savez(path, t=t, q=q, qd=qd + 1e-4 * noise[0], tau=tau + friction + 0.1 * noise[1])
    options = ["--urdf", recording.urdf, "--report", page, "-o", page.with_suffix(".yaml")]
    assert main(list(map(str, ["identify", path, "--quiet", *options]))) == 0
    with Tab(chromium, (718, 1040)) as tab:
        tab.page.emulate_media(media="print")
        tab.page.goto(page.as_uri())
        assert tab.cut_off() == []
