# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The page in Chromium. One smoke test is of the gate; the functions of the page have tests of their own in web/test."""

import colorsys
import csv
import io
import threading
import time

import numpy as np
import pytest
from PIL import Image

import diag_dynamics as dd
import page_fixture
import recorded_arm
from bags import odometry, write_floating
from browser import Tab, browser
from diag_dynamics.cli.main import main
from diag_dynamics.description.catalog import find_urdf
from diag_dynamics.page.forces import ForceOptions
from diag_dynamics.page.frames import States
from diag_dynamics.page.layout import center_of_body
from diag_dynamics.page.meshes import MeshLibrary
from diag_dynamics.page.scene import mesh_folders, scene_of
from diag_dynamics.page.server import PageServer
from diag_dynamics.page.stream import Received, RobotStream
from hostile import START, Driver
from moving_robot import MovingRobot
from recorded_arm import ARM, WATCHED, Recording
from robots import description, joint, link

pytestmark = pytest.mark.browser


@pytest.fixture(scope="module")
def chromium():
    with browser() as one:
        yield one


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
    """Serve robots in this process; returns a function that takes their streams and returns the server."""
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
        self.silent, self.doubtful = threading.Event(), threading.Event()

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
        tab.open(f"{server.address}#robot=/arm")
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
    names, dyn = robot.model.dof_names, dd.DiagonalDynamics(robot.model)
    values, (q, qd, tau, external), s = paused(live, robot)
    expected = {
        **{
            "q": q,
            "qd": qd,
            "effort": tau,
            "nu": s.nu,
            "coriolis": s.coriolis,
            "gravity": s.gravity,
        },
        **{"D": s.articulated_inertia, "K": [s.kinetic_energy], "link_energy": s.link_energy},
        **{"external_torque": external, "gravity_torque": dyn.gravity_torque(q)},
    }
    for name, wanted in expected.items():
        scale = max(np.abs(wanted).max(), 1e-3)
        np.testing.assert_allclose(values[name], wanted, rtol=1e-4, atol=1e-4 * scale, err_msg=name)
    exchange = live.ask("diag.plots.exchange.values")
    wanted = s.nu * s.coriolis
    np.testing.assert_allclose(
        [exchange[name] for name in names], wanted, rtol=1e-3, atol=2e-4 * np.abs(wanted).max()
    )
    rows = live.page.locator(".joints tbody tr").all_inner_texts()
    np.testing.assert_allclose(
        [read_number(row.split()[1]) for row in rows], s.energy_share, rtol=0.01, atol=1e-4
    )
    last = rows_of(live)[-1]
    assert float(last["t [s]"]) == values["t"]
    np.testing.assert_allclose(
        [float(last[f"nu.{name}"]) for name in names], values["nu"], rtol=1e-6
    )


@pytest.mark.full
def test_the_effective_mass_of_a_link_that_was_clicked(live, panda):
    """1/(uᵀ J M⁻¹Jᵀ u) along the link's velocity."""
    live.page.keyboard.press(" ")  # a link that stands still can be hit
    live.until("diag.state.paused && diag.values.t === diag.state.now")
    place = live.until("diag.where('panda_link6')")
    live.page.mouse.click(place["x"], place["y"])
    live.page.keyboard.press(" ")
    live.until(
        "diag.marks && diag.marks.link === 'panda_link6' && diag.values.link_velocity[0] === diag.values.link_velocity[0]"
    )
    _, (q, qd, _, _), _ = paused(live, panda[0])
    dyn, marks = dd.DiagonalDynamics(panda[0].model), live.until("diag.marks")
    velocity = dyn.link_velocity(q, "panda_link6", qd, frame="world")[:3]
    mobility = dyn.operational_inverse_inertia(q, "panda_link6", frame="world")[:3, :3]
    speed = np.linalg.norm(velocity)
    assert marks["speed"] == pytest.approx(speed, rel=1e-3)
    assert marks["mass"] == pytest.approx(speed**2 / (velocity @ mobility @ velocity), rel=1e-2)
    assert "panda_link6" in live.page.locator(".details h2").inner_text()


@pytest.mark.full
@pytest.mark.parametrize(("key", "by"), [("1", "share"), ("3", "torque")])
def test_links_have_the_colours_of_their_numbers(live, panda, key, by):
    """The canvas has the hue of a link's number; web/test compares the numbers' colours."""
    live.page.keyboard.press(key)
    paused(live, panda[0])
    live.until(f"diag.colours.by === '{by}'")
    colours = live.ask("diag.colours.links")
    live.drawn()
    picture, seen = Image.open(io.BytesIO(live.page.screenshot())).convert("RGB"), 0
    for name, text in colours.items():
        place = live.ask(f"diag.where('{name}')")
        hue, saturation, _ = colorsys.rgb_to_hsv(
            *(int(text[n : n + 2], 16) / 255 for n in (1, 3, 5))
        )
        if place is not None and saturation >= 0.25:
            pixel = np.array(picture.getpixel((round(place["x"]), round(place["y"])))) / 255
            found, strength, _ = colorsys.rgb_to_hsv(*pixel)
            seen += (
                strength > 0.12 and abs((found - hue + 0.5) % 1.0 - 0.5) < 0.08
            )  # not where light is mirrored
    assert seen >= 3


@pytest.mark.full
def test_keys_scrubbing_and_the_cursor(live):
    page = live.page
    page.keyboard.press("+")
    live.until("diag.state.window[1] - diag.state.window[0] === 15")
    page.keyboard.press("-")
    live.until("diag.state.last - diag.state.first > 2")
    strip = page.locator(".timeline").bounding_box()
    for act, part in ((page.mouse.down, 0.7), (page.mouse.up, 0.4)):
        page.mouse.move(strip["x"] + part * strip["width"], strip["y"] + 5)
        act()
    state = live.until("diag.state.paused && diag.state")
    first, ends = state["first"], (state["window"][1], state["last"])  # at the pause, and now
    assert (
        first + 0.4 * (ends[0] - first) - 0.2 < state["now"] < first + 0.4 * (ends[1] - first) + 0.2
    )
    page.keyboard.press("ArrowRight")
    live.until(f"diag.state.now > {state['now']!r}")
    card = page.locator("#plot-exchange .u-over").bounding_box()
    page.mouse.move(card["x"] + 0.9 * card["width"], card["y"] + 20)
    overs = "[...document.querySelectorAll('.u-over')].map((over) => [over, over.querySelector('.cursor')])"
    part = "new DOMMatrix(c.style.transform).e / o.clientWidth"
    live.until(
        f"{overs}.filter(([o, c]) => c && !c.hidden && Math.abs({part} - 0.9) < 0.02).length >= 6"
    )
    for shown in (True, False):
        page.keyboard.press("?")
        assert page.locator("dialog.help").is_visible() is shown


@pytest.mark.full
def test_doubts_silence_diagnostics_and_another_robot(live, panda):
    robot, _ = panda
    live.until("document.querySelector('.diagnostics').innerText.includes('a gap of 0.2 s')")
    robot.doubtful.set()
    live.until("diag.state.notes.includes('velocities estimated') && diag.state.level === 'warn'")
    live.until(
        "[...document.querySelectorAll('.joints td:last-child b')].every((b) => b.textContent === '–')"
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


@pytest.mark.full
def test_legends_hide_lines_and_fit_the_axis(live):
    """Hidden lines stay hidden while states come; the axis is that of the shown lines."""
    chips = live.page.locator("#plot-power .legend button")
    pressed = "[...document.querySelectorAll('#plot-power .legend button')].map((chip) => chip.ariaPressed === 'true')"
    before = live.until("diag.plots.power.range")
    chips.nth(4).click(modifiers=["Shift"])  # dK/dt alone
    assert live.ask(pressed) == [False] * 4 + [True]
    live.until(f"diag.plots.power.range[1] < 0.7 * {before[1]!r}")  # torque and gravity are larger
    live.until(
        f"diag.state.last > {live.ask('diag.state.last')!r} + 2.5"
    )  # the lines are chosen again every 2 s
    assert live.ask(pressed) == [False] * 4 + [True]
    chips.nth(0).focus()
    live.page.keyboard.press("Space")
    assert live.ask(pressed) == [True, False, False, False, True]
    assert not live.ask("diag.state.paused")
    chips.nth(4).dblclick()
    chips.nth(4).dblclick()
    assert live.ask(pressed) == [True] * 5


@pytest.mark.full
def test_cards_are_enlarged_and_chosen(live):
    page, width = live.page, "document.querySelector('#plot-norm canvas').clientWidth"
    shown = "[...document.querySelectorAll('.card')].filter((card) => card.offsetWidth).map((card) => card.id)"
    before, small = live.ask(shown), live.ask(width)
    page.locator("#plot-norm h2").click()
    live.until(f"{width} > 2 * {small}")
    assert live.ask(shown) == ["plot-norm"]
    assert live.cut_off() == []
    page.keyboard.press("Escape")
    page.get_by_text("Cards", exact=True).click()
    page.get_by_label("Diagnostics").uncheck()
    page.keyboard.press("Escape")
    assert live.ask(shown) == [name for name in before if name != "diagnostics"]
    page.reload(wait_until="domcontentloaded")
    live.until("diag.state.ready")
    assert "diagnostics" not in live.ask(shown)
    page.get_by_text("Cards", exact=True).click()
    page.get_by_label("Diagnostics").check()
    page.keyboard.press("Escape")
    assert live.ask(shown) == before


@pytest.mark.full
def test_a_link_restores_the_state(live, chromium):
    """A page by the link has robot, joint, colour, camera and cards; what is wrong in a link is named and ignored."""
    page = live.page
    for key in ("j", "3", "v", "y"):
        page.keyboard.press(key)
    page.locator("#plot-power h2").click()
    live.until("location.hash.includes('card=power') && location.hash.includes('camera=front')")
    link, joint = live.ask("location.href"), page.locator(".details h2").inner_text()
    with Tab(chromium) as other:
        other.open(link)
        other.until(
            "diag.colours.by === 'torque' && diag.camera === 'front' && diag.state.namespace === '/arm'"
        )
        other.until("document.querySelector('#plot-power.large')")
        other.page.keyboard.press("Escape")
        assert other.page.locator(".details h2").inner_text() == joint
        other.ask("void (location.hash = '#robot=/other&joint=elbow_joint&t=soon&window=12')")
        other.until(
            "diag.state.namespace === '/other' && diag.state.window[1] - diag.state.window[0] === 12"
        )
        other.until("document.querySelector('.details h2').textContent.startsWith('elbow_joint')")
        assert "t is 'soon'; expected a number" in other.page.locator(".notice").inner_text()
        other.page.locator(".notice").click()
        other.ask("void (location.hash = '#robot=/nobody')")
        other.until("document.querySelector('.notice').textContent.includes('/nobody')")
        assert (other.said, other.ask("diag.errors")) == ([], [])
    page.keyboard.press("Escape")
    page.keyboard.press("Shift+F")


@pytest.mark.full
def test_the_camera_fits_follows_and_has_views(live, panda):
    """All links are within the picture at each view and size; a followed link stays at its centre."""
    for width, height in ((390, 844), (1400, 500), (1280, 720)):
        live.page.set_viewport_size({"width": width, "height": height})
        for view in ("Front", "Side", "Top", "Iso"):
            live.page.get_by_role("button", name=view, exact=True).click()
            live.until(f"diag.camera === '{view.lower()}' && diag.outside.length === 0")
    live.page.keyboard.press("g")
    first = live.ask("diag.target")
    live.until(f"Math.hypot(...diag.target.map((x, k) => x - {first}[k])) > 0.05")
    _, (q, *_), _ = paused(live, panda[0])
    place = dd.DiagonalDynamics(panda[0].model).placement(q, "panda_hand")[:3, 3]
    np.testing.assert_allclose(live.ask("diag.target"), place, atol=1e-4)
    live.page.keyboard.press("Shift+F")
    live.until("diag.camera === 'iso' && diag.outside.length === 0")


@pytest.mark.full
def test_all_robots_in_one_scene(live):
    """The other robot stands beside the chosen one, has its state at the same time, and a click on it chooses it."""
    live.page.keyboard.press("a")
    live.until(
        "diag.others.length === 1 && !diag.others[0].pending && !diag.others[0].old && diag.outside.length === 0"
    )
    other = live.ask("diag.others[0]")
    assert other["name"] == "/other"
    assert other["place"][1] > 1.0
    assert len(set(other["colours"].values())) > 2
    live.until(f"diag.others[0].t > {other['t']!r} + 0.5")
    live.page.keyboard.press(" ")
    live.until("diag.state.paused && Math.abs(diag.others[0].t - diag.state.now) < 1")
    place = live.until("diag.where('forearm_link', '/other')")
    live.page.mouse.click(place["x"], place["y"])
    live.until(
        "diag.state.namespace === '/other' && diag.others[0] && diag.others[0].name === '/arm'"
    )
    live.until(
        "document.querySelector('.tag.chosen').textContent === '/other' && location.hash.includes('all=1')"
    )
    assert live.cut_off() == []
    live.page.get_by_role("button", name="/arm", exact=True).click()
    live.until("diag.state.namespace === '/arm' && diag.state.ready")
    live.page.keyboard.press("a")
    live.until("diag.others.length === 0 && !document.querySelector('.tag')")


@pytest.mark.full
def test_no_text_is_cut_off(live):
    for width, height in (*SIZES, (1280, 720)):
        live.page.set_viewport_size({"width": width, "height": height})
        live.page.keyboard.press("Escape")
        assert live.cut_off() == [], (width, height)
        live.page.keyboard.press("j")
        live.until("!document.querySelector('.details').hidden")
        assert live.cut_off() == [], (width, height, "with details")
        below = "(({ scrollHeight, clientHeight }) => scrollHeight - clientHeight)(document.querySelector('.details'))"
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
def test_force_on_the_touched_link(chromium, serve):
    """From the centre of mass of the link's body along the force; chip, list and robot name one link and force."""
    urdf, link, noise = (
        str(find_urdf("ur5")),
        "wrist_2_link",
        ForceOptions(0.01 * np.eye(6), ("wrist_3_link",)),
    )
    robot = Robot(dd.load_urdf(urdf))
    dyn, links = dd.DiagonalDynamics(robot.model), robot.model.link_names
    center = center_of_body(robot.model, link)

    def read(dynamics):
        received = robot.take(dynamics)
        if received is None:
            return None
        pushed = (received.states.t[0] % 2.0) < 1.5
        J = dyn.jacobian(received.states.q[0], link, center, frame="world")[:3]
        touch = {
            "external_torque": (np.array([0.0, 20.0, -10.0]) @ J)[None],
            "contact": pushed,
            "collision": False,
        }
        touch |= {"touched_link": links.index(link) if pushed else -1, "touched_confidence": 0.7}
        return received._replace(states=received.states._replace(**touch))

    stream = RobotStream("/pushed", read)
    stream.set_robot(dd.DiagonalDynamics(robot.model), scene_of(robot.model, urdf), None, noise)
    with Tab(chromium) as tab:
        tab.open(serve(stream).address)
        tab.until("diag.force && document.querySelector('#collisions .link')")
        tab.page.keyboard.press(" ")
        tab.page.keyboard.press("b")
        tab.until("diag.state.paused && diag.values.t === diag.state.now")
        tab.drawn()
        values, force = tab.ask("diag.values"), tab.ask("diag.force")
        X, arrow = (
            dyn.placement(robot.at(values["t"])[0], link),
            np.subtract(force["tip"], force["from"]),
        )
        np.testing.assert_allclose(force["from"], X[:3, :3] @ center + X[:3, 3], atol=1e-3)
        np.testing.assert_allclose(
            arrow / np.linalg.norm(arrow), np.array([0.0, 2.0, -1.0]) / 5**0.5, atol=1e-3
        )
        said = " ".join(tab.page.locator(".force").inner_text().split())
        assert force["ellipsoid"] and said.startswith(f"contact: {link} (70 %), 22.4 ±")
        words = " ".join(tab.page.locator("#collisions tr.chosen").inner_text().split())
        assert f"{link} (70 %)" in words and "22.4 ±" in words
        (note,) = (text for text in tab.ask("diag.state.notes") if "contact" in text)
        assert " ".join(note.split()) == said
        stream.set_diagnostics([status(0, "external torque", "contact: base_link (0.9)")])
        tab.until(f"document.querySelector('.diagnostics').innerText.includes({note!r})")
        assert tab.page.locator("#collisions h2").inner_text().startswith("No collisions, ")
        assert tab.said == []


@pytest.mark.full
def test_contact_now_and_then(chromium, serve):
    """Each point has its numbers and half the mass beside them, now and at a past moment."""
    begun, names, quiet = time.time(), ("link1", "link2"), threading.Event()

    def contact_at(t):
        speed, position = (
            np.array([[0.1, 0.2]]) * (t - begun),
            np.array([[0.0, 0.0, 0.1 * (t - begun)]]),
        )
        numbers = {
            "worst": np.zeros(1),
            "position": position,
            "speed": speed,
            "mass": np.ones((1, 2)),
        }
        numbers |= {
            "energy": 0.5 * speed**2,
            "allowed": np.array([[-1.0, np.inf]]),
        }  # the first is above its limit
        return {f"contact_limits_{name}": number for name, number in numbers.items()}

    def read(dynamics):
        received = robot.take(dynamics)
        if received is None:
            return None
        contact = {} if quiet.is_set() else contact_at(received.states.t[0])
        return received._replace(
            states=received.states._replace(**contact), points=tuple(zip(names, names, strict=True))
        )

    text = chain(["one", "two"])
    robot, stream = Robot(dd.load_urdf(text)), RobotStream("/touched", read)
    stream.set_robot(dd.DiagonalDynamics(robot.model), scene_of(robot.model, text))
    with Tab(chromium) as tab:
        tab.open(serve(stream).address)
        tab.until("document.querySelectorAll('.contact tr.above').length === 1 && diag.contact")
        assert "0.300 kg" in tab.page.locator("#contact-limits p").inner_text()
        past = tab.until("diag.values.t")
        tab.until(f"diag.state.last > {past!r} + 0.5")
        tab.page.keyboard.press("Space")
        tab.ask(f"diag.go({past!r})")
        tab.until(f"diag.values.t === {past!r}")
        tab.drawn()
        contact = contact_at(past)
        np.testing.assert_allclose(
            tab.ask("diag.contact"), contact["contact_limits_position"][0], rtol=1e-5, atol=1e-6
        )
        cells = [
            read_number(cell)
            for cell in tab.page.locator(".contact tbody tr").first.inner_text().split()[1:]
        ]
        v = contact["contact_limits_speed"][0, 0]
        np.testing.assert_allclose(
            cells, [-1 - v, v, 1, 0.5 * v * v, 0.15 * v * v], rtol=6e-3, atol=6e-4
        )
        tab.page.keyboard.press("l")
        quiet.set()
        tab.until("diag.contact === null && document.querySelector('#contact-limits.old')")
        assert (tab.cut_off(), tab.said) == ([], [])


@pytest.mark.full
def test_the_worst_status_is_seen_at_once(chromium, serve):
    """Head and banner have the reason why there is no state."""
    text, refused = chain(["one", "two"]), "parameter 'alarm.joints' names 'elbow'"
    robot = Robot(dd.load_urdf(text))
    stream = RobotStream("/late", robot.take)
    stream.set_diagnostics([status(1, "rates", "a gap"), status(2, "model", refused)])
    with Tab(chromium, (1280, 720), "light") as tab:
        tab.page.goto(serve(stream).address, wait_until="domcontentloaded")
        tab.until("diag.state.word === 'Error' && diag.state.worst")
        for place in (".banner", ".worst", ".diagnostics"):
            tab.until(f'document.querySelector("{place}").textContent.includes("{refused}")')
            assert tab.page.locator(place).is_visible()
        stream.set_robot(dd.DiagonalDynamics(robot.model), scene_of(robot.model, text))
        tab.until(
            "diag.state.word === 'Live' && diag.state.level === 'bad' && document.querySelector('.banner').hidden"
        )
        robot.silent.set()
        tab.until("diag.state.word === 'Stale' && !document.querySelector('.banner').hidden")
        assert refused in tab.page.locator(".banner").inner_text()
        stream.set_diagnostics([status(0, "model", "as expected")])
        robot.silent.clear()
        tab.until("diag.state.level === 'good' && document.querySelector('.worst').hidden")
        assert tab.said == []


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
    """Numbers and contact of moments in the overview and at full rate, words, buttons and panels; without a network."""
    options = [
        "--quiet",
        "--set",
        *WATCHED,
        f"contact_limits.file={recording.folder / 'limits.yaml'}",
    ]
    html, summary = recording.analyse("page", *options, **recording.columns())
    dyn, model = recording.dyn, recording.model
    limits = dd.ContactLimits.load(recording.folder / "limits.yaml")
    points = dd.ContactPoints(model, dd.link_geometry(model, ARM).points, limits, "limit")
    with Tab(chromium) as tab:
        tab.open(html.as_uri())
        for moment in (0.5, 2.1, 2.113, 6.7):
            values, place = show_moment(tab, moment)
            k = round(values["t"] * recorded_arm.RATE)
            s, c = (
                dyn.evaluate(recording.q[k], recording.qd[k]),
                dyn.contact_limits(recording.q[k], recording.qd[k], points),
            )
            np.testing.assert_allclose(values["nu"], s.nu, atol=1e-3 * np.abs(s.nu).max())
            np.testing.assert_allclose(values["K"][0], s.kinetic_energy, rtol=2e-3)
            assert values["contact_limits_worst"] == [c.worst]
            np.testing.assert_allclose(values["contact_limits_speed"], c.speed, atol=1e-4)
            np.testing.assert_allclose(place, c.position[c.worst], atol=1e-3)
        words = {
            name: " ".join(tab.page.locator(f"#{name}").inner_text().split()) for name in CHAPTERS
        }
        assert f"{summary['kinetic_energy']['at']:.3f} s" in words["overall"]
        assert f"{summary['kinetic_energy']['max']:.3f} J" in words["overall"]
        assert f"{summary['contact_limits']['worst'][0]['at']:.3f} s" in words["limits"]
        assert words["collisions"].startswith("1 collision")
        assert "external_torque.threshold" in words["parameters"]
        tab.page.locator("#collisions .link").first.click()
        tab.until(
            "diag.state.window[1] - diag.state.window[0] < 6 && diag.values.t === diag.state.now"
        )
        assert tab.ask("diag.values.norm[0]") == pytest.approx(
            summary["collisions"][0]["norm"], rel=1e-3
        )
        assert len(rows_of(tab)) > 4.0 * recorded_arm.RATE
        tab.page.keyboard.press("0")
        tab.until(f"diag.state.window[1] - diag.state.window[0] > {recorded_arm.LENGTH - 0.1}")
        for width, height in SIZES:
            tab.page.set_viewport_size({"width": width, "height": height})
            assert tab.cut_off() == [], (width, height)
        assert (tab.said, tab.ask("diag.errors"), tab.ask("diag.missing")) == ([], [], 0)
        assert tab.asked <= {"file://", "data://", "blob://"}
        tab.ask("diag.go(2.113)")
        tab.until("decodeURI(location.hash).includes(`t=${diag.state.now}`)")
        link, now = tab.ask("location.href"), tab.ask("diag.state.now")
    with Tab(chromium) as tab:
        tab.open(link)
        tab.until(f"diag.state.now === {now!r}")
        assert tab.said == []


CHAPTERS = "overall", "collisions", "limits", "parameters"


@pytest.mark.full
def test_the_worst_point_moves_with_a_floating_base(chromium, tmp_path):
    """Its position is in the root link's axes, which move."""
    model = dd.load_robot("panda", floating_base=True)
    driver, count = Driver(dd.load_robot("panda"), 1), 1000
    joints, bases = [], []
    for k in range(count):
        now, turn = START + k * 2 * 10**6, 0.5 * 1.3 * k / count
        pose = (4.0 * k / count, np.sin(5.0 * k / count), 0.8, 0.0, 0.0, np.sin(turn), np.cos(turn))
        bases.append((now, odometry(now, model.root_link, pose, (1.2, 0.3, 0.0, 0.0, 0.0, 0.4))))
        joints.append((driver.good(now), now))
    path, html = write_floating(tmp_path / "base.mcap", joints, bases), tmp_path / "base.html"
    arguments = ["--urdf", "panda", "--quiet", "--set", "floating_base=true", "--report", str(html)]
    assert main(["analyse", str(path), *arguments]) in (0, 1)
    rec = dd.read_recording(path, str(find_urdf("panda")), parameters={"floating_base": True})
    dyn = dd.DiagonalDynamics(rec.model)
    points = dd.ContactPoints(rec.model, dd.link_geometry(rec.model, find_urdf("panda")).points)
    with Tab(chromium, (1280, 720), "light") as tab:
        tab.open(html.as_uri())
        for moment in (0.2, 1.8, 0.4):
            values, drawn = show_moment(tab, moment)
            k = int(np.argmin(np.abs(rec.t - rec.t[0] - values["t"])))
            c, root = (
                dyn.contact_limits(rec.q[k], rec.qd[k], points),
                dyn.placement(rec.q[k], rec.model.root_link),
            )
            assert values["contact_limits_worst"] == [c.worst]
            place = root[:3, :3] @ c.position[c.worst] + root[:3, 3]
            np.testing.assert_allclose(drawn, place, atol=3e-4)
        assert tab.said == []
