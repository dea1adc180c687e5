# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The page in a real Chromium: what it shows are the numbers of the states, wherever it is looked at, whatever happens."""

import colorsys
import csv
import io
import itertools
import json
import re
import struct
import threading
import time
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import numpy as np
import pytest
from PIL import Image

import diag_dynamics as dd
from browser import Tab, browser
from diag_dynamics.demos.moving_robot import MovingRobot, show_of
from diag_dynamics.model.example_robots import find_urdf
from diag_dynamics.page.contact import Touch
from diag_dynamics.page.frames import FrameMaker, Told
from diag_dynamics.page.meshes import MeshLibrary
from diag_dynamics.page.scene import mesh_folders, scene_of
from diag_dynamics.page.server import STATIC, PageServer
from diag_dynamics.page.show import Show, Taken

pytestmark = [pytest.mark.full, pytest.mark.browser]

pytest.importorskip("yourdfpy")
RATE = 100.0
SIZES = (360, 740), (1280, 720), (1920, 1080), (3840, 2160)
RAMP = np.array([[70, 96, 128], [46, 142, 158], [116, 186, 118], [240, 190, 66], [226, 74, 58]], dtype=float)
UNKNOWN = "#969ca4"


class Robot(MovingRobot):
    """A moving robot that can be stopped, and told of otherwise than as it is."""

    def __init__(self, model, rate=RATE):
        super().__init__(model, rate)
        self.silent, self.told = threading.Event(), {}
        self._limits = (*np.full(model.nv, 12.0), np.inf, 8.0)

    def take(self, dynamics):
        if self.silent.is_set():
            return None
        taken = super().take(dynamics)
        if taken is None or not self.told:
            return taken
        seen = taken.seen._replace(valid=[False]) if self.told.get("no_result") else taken.seen
        told = Told(velocity_estimated=bool(self.told.get("estimated")), latency=0.001)
        return Taken(taken.states, seen, told, taken.received, taken.count, taken.limits)


def shown(urdf, name, cls=Robot, model=None):
    model = model or dd.load_urdf(urdf, massless="lock")
    robot = cls(model)
    show = Show(name, robot.take)
    meshes = MeshLibrary(mesh_folders(urdf) if not urdf.startswith("<") else ())
    show.use(dd.DiagonalDynamics(model), scene_of(model, urdf, meshes), meshes)
    show.tell([{"level": 1, "name": f"{name}: joint states", "message": "a gap of 0.2 s", "values": {"gaps": 1}}])
    return robot, show


@pytest.fixture(scope="module")
def chromium():
    with browser() as one:
        yield one


@pytest.fixture(scope="module")
def panda():
    return shown(str(find_urdf("panda")), "/arm")


@pytest.fixture(scope="module")
def ur5():
    return shown(str(find_urdf("ur5")), "/other")


@pytest.fixture(scope="module")
def server(panda, ur5):
    one = PageServer(lambda: [panda[1], ur5[1]])
    one.start()
    yield one
    one.stop()


# --- Pages of their own, which come first: with one page open, a machine without a graphics card is busy ---


def chain(names):
    """A URDF of links in a row, by the names of its joints."""
    links = "".join(
        f'<link name="link{k}"><inertial><origin xyz="0 0 0.05"/><mass value="0.3"/>'
        '<inertia ixx="1e-3" iyy="1e-3" izz="1e-3" ixy="0" ixz="0" iyz="0"/></inertial>'
        '<visual><origin xyz="0 0 0.05"/><geometry><cylinder radius="0.02" length="0.1"/></geometry></visual></link>'
        for k in range(len(names) + 1)
    )
    joints = "".join(
        f'<joint name="{name}" type="revolute"><parent link="link{k}"/><child link="link{k + 1}"/><origin xyz="0 0 0.1"/>'
        f'<axis xyz="{k % 2} {1 - k % 2} 0"/><limit lower="-0.2" upper="0.2" effort="50" velocity="3"/></joint>'
        for k, name in enumerate(names)
    )
    return f'<robot name="chain">{links}{joints}</robot>'


def test_sixty_joints_and_names_that_are_html(chromium):
    """Bars of the top few and others; a name is a text, whatever is in it."""
    hostile = "&lt;img src=x onerror=alert(1)&gt;"
    _, show = shown(chain([hostile, *(f"a_long_name_of_joint_{k}" for k in range(59))]), "/<b>long")
    one = PageServer(lambda: [show])
    one.start()
    tab = Tab(chromium, (1000, 700), "light")
    try:
        tab.open(one.address)
        tab.until("document.querySelectorAll('.joints tbody tr').length === 11")
        for size in ((1280, 720), (1000, 700)):
            tab.page.set_viewport_size({"width": size[0], "height": size[1]})
            assert tab.out_of_panels() == [], size
        assert "50 others" in tab.page.locator(".joints").inner_text()
        assert all(len(plot["values"]) <= 9 for plot in tab.ask("Object.values(diag.plots)"))
        tab.until("Math.min(...[...document.querySelectorAll('.plot')].map((p) => p.clientHeight)) >= 80")
        tab.page.keyboard.press("j")  # the joint with that name
        tab.until("document.querySelector('.details h2').textContent.includes('<img src=x')")
        assert tab.ask("document.querySelectorAll('img').length") == 0
        assert tab.cut_off() == []
        tab.page.locator(".joints tr", has_text="others").click()
        tab.until("document.querySelectorAll('.joints tbody tr').length === 60")
        assert tab.said == []
    finally:
        tab.close()
        one.stop()


@pytest.mark.filterwarnings("ignore::diag_dynamics.exceptions.InertiaWarning")
def test_a_robot_without_shapes_is_seen_as_bones(chromium):
    """All links of it are within the picture, though their inertias are such as no body has."""
    text = re.sub(r"<visual>.*?</visual>", "", chain(["one", "two", "three"])).replace('izz="1e-3"', 'izz="3e-3"')
    _, show = shown(text, "/bones")
    one = PageServer(lambda: [show])
    one.start()
    tab = Tab(chromium, (1280, 720), "light")
    try:
        tab.open(one.address)
        tab.page.keyboard.press("e")  # without ellipsoid and arrow
        picture = tab.page.locator(".stage").bounding_box()
        for name in ("link0", "link1", "link2", "link3"):
            place = tab.until(f"diag.where('{name}')")
            assert picture["x"] < place["x"] < picture["x"] + picture["width"]
            assert picture["y"] < place["y"] < picture["y"] + picture["height"]
        assert tab.said == []
    finally:
        tab.close()
        one.stop()


@pytest.mark.parametrize("payload", [0.0, 4.0])
def test_begins_with_the_hand_and_short_names_are_words(chromium, payload):
    """Not with a finger of some grams, which moves as easily as nothing; and a joint is not called "0_joint"."""
    fingers = "".join(
        f'<link name="finger{k}"><inertial><mass value="0.02"/><inertia ixx="1e-6" iyy="1e-6" izz="1e-6" ixy="0" ixz="0"'
        f' iyz="0"/></inertial></link><joint name="lwr_finger{k}" type="prismatic"><parent link="link3"/>'
        f'<child link="finger{k}"/><origin xyz="0 0 0.05"/><axis xyz="0 1 0"/><limit lower="0" upper="0.04" effort="20"'
        ' velocity="0.2"/></joint>'
        for k in range(2)
    )
    text = chain([f"lwr_{k}_joint" for k in range(3)]).replace("</robot>", f"{fingers}</robot>")
    model = dd.load_urdf(text).with_payload("link3", payload, (0.0, 0.0, 0.1))
    _, show = shown(text, "/hand", model=model)
    one = PageServer(lambda: [show])
    one.start()
    tab = Tab(chromium, (800, 600), "light")
    try:
        tab.open(one.address)
        tab.until("diag.marks && diag.marks.link === 'link3'")
        names = tab.page.locator(".joints tbody th").all_inner_texts()
        assert [name.strip() for name in names] == list(model.dof_names)
    finally:
        tab.close()
        one.stop()


def test_a_phone_has_a_head_of_two_lines_and_the_picture_room_for_words(chromium):
    """With a sentence of the diagnostics in it; and what a robot reaches later is within the picture, below the words."""
    text = re.sub(r"<visual>.*?</visual>", "", chain([f"a_rather_long_joint_name_{k}" for k in range(12)]))
    text = text.replace('"link', '"a_rather_long_link_name_').replace(
        'lower="-0.2" upper="0.2"', 'lower="-2" upper="2"'
    )
    _, show = shown(text, "/phone")
    show.tell([{"level": 2, "name": "diag_dynamics: contact", "message": f"too fast: {'very ' * 30}", "values": {}}])
    one = PageServer(lambda: [show])
    one.start()
    tab = Tab(chromium, (360, 740), "light")
    try:
        tab.open(one.address)
        tab.until("diag.state.worst")  # it may be told of after the first state
        boxes = "['body > .bar', '.worst', 'body > .bar button:last-child'].map((one) => document.querySelector(one))"
        head, worst, button = tab.ask(f"{boxes}.map((one) => one.getBoundingClientRect().toJSON())")
        assert button["y"] < worst["y"] < head["height"]
        assert worst["height"] + button["height"] + 20 > head["height"], "a third line"
        words = tab.page.locator(".headline").bounding_box()
        tab.page.keyboard.press("e")
        reached = "['0', '6', '12'].map((k) => diag.where(`a_rather_long_link_name_${k}`)).every((p) => p && p.y > "
        begun = tab.ask("diag.state.now")
        tab.until(f"diag.state.now > {begun} + 2 && {reached}{words['y'] + words['height'] - 12})")
        assert tab.cut_off() == []
        assert tab.said == []
    finally:
        tab.close()
        one.stop()


def test_what_a_touch_would_cost(chromium):
    """Numbers of each point as they were told, what half of the mass would have said, and the worst point in the picture."""
    text = chain(["one", "two"])
    model = dd.load_urdf(text)
    robot = Robot(model)
    speed, mass = np.array([0.5, 0.25]), np.array([0.8, 0.3])
    places, allowed = np.array([[0.0, 0.0, 0.2], [0.02, 0.0, 0.3]]), np.array([0.4, np.inf])
    names, quiet = ["link1", "link2"], threading.Event()

    def take(_):
        touch = Touch(time.time(), names, names, places, speed, mass, 0.5 * mass * speed**2, allowed, 0, False)
        return None if quiet.is_set() else touch

    show = Show("/touched", robot.take, take)
    show.use(dd.DiagonalDynamics(model), scene_of(model, text), None)
    one = PageServer(lambda: [show])
    one.start()
    tab = Tab(chromium, (1280, 720), "dark")
    try:
        tab.open(one.address)
        drawn = tab.until(
            "document.querySelectorAll('.touch tbody tr').length === 2 && diag.contact && diag.contact.drawn"
        )
        rows = [row.split() for row in tab.page.locator(".touch tbody tr").all_inner_texts()]
        assert [row[0] for row in rows] == names  # the one with a limit first
        half = 0.5 * 2 * 0.3
        for row, v, m in zip(rows, speed, mass, strict=True):
            np.testing.assert_allclose(
                [read(x) for x in row[2:]], [v, m, 0.5 * m * v * v, 0.5 * half * v * v], rtol=6e-3
            )
        assert read(rows[0][1]) == pytest.approx(-0.1)
        assert rows[1][1] == "–"
        assert "0.300 kg" in tab.page.locator("#contact p").inner_text()
        np.testing.assert_allclose(drawn, places[0], atol=1e-6)
        assert tab.page.locator(".touch tr.above").count() == 1
        assert tab.cut_off() == []
        assert tab.out_of_panels() == []
        tab.page.set_viewport_size({"width": 390, "height": 844})
        assert tab.cut_off() == []
        quiet.set()
        tab.until("!diag.contact.fresh && diag.contact.drawn === null && document.querySelector('#contact.old')")
        assert tab.said == []
    finally:
        tab.close()
        one.stop()


def test_what_a_touch_would_have_cost(chromium):
    """While somebody looks back: table and worst point of that moment, of all that the page has been told the nearest."""
    text = chain(["one", "two"])
    model = dd.load_urdf(text)
    robot, begun = Robot(model), time.time()
    told, names = {}, ["link1", "link2"]

    def take(_):
        t = time.time()
        speed = np.array([0.1, 0.2]) * (t - begun)  # so that each moment has its own
        places = np.array([[0.0, 0.0, 0.1 * (t - begun)], [0.0, 0.0, 0.3]])
        told[t] = speed, places
        return Touch(t, names, names, places, speed, np.ones(2), 0.5 * speed**2, np.array([0.5, np.inf]), 0, False)

    show = Show("/touched", robot.take, take)
    show.use(dd.DiagonalDynamics(model), scene_of(model, text), None)
    one = PageServer(lambda: [show])
    one.start()
    tab = Tab(chromium, (1280, 720), "dark")
    try:
        tab.open(one.address)
        arrived = [tab.until("diag.contact && diag.contact.t")]  # some of those that have come
        while len(arrived) < 8:
            arrived.append(tab.until(f"diag.contact.t > {arrived[-1]!r} && diag.contact.t"))
        tab.until(f"diag.contact.t > {arrived[-1]!r} && diag.state.last > {arrived[-1]!r}")
        tab.until("document.querySelector('#contact h2').textContent.includes('now')")
        tab.page.keyboard.press("Space")
        for t in arrived[1::3]:
            after = min(other for other in list(told) if other > t)
            tab.ask(f"diag.go({t + 0.3 * (after - t)!r})")
            tab.drawn()
            at = tab.ask("diag.values.t")  # of the state that is shown: where few have come, it may be far from there
            nearest = min(list(told), key=lambda other, at=at: abs(other - at))
            tab.until(f"diag.contact.shown && diag.contact.shown.t === {nearest!r}")
            seen = tab.ask("diag.contact.shown")
            speed, places = told[nearest]
            np.testing.assert_allclose([point["speed"] for point in seen["points"]], speed, rtol=1e-6)
            np.testing.assert_allclose(tab.ask("diag.contact.drawn"), places[0], rtol=1e-6, atol=1e-6)
            assert seen["points"][1]["margin"] is None
            row = tab.page.locator(".touch tbody tr").first.inner_text().split()
            assert read(row[2]) == pytest.approx(speed[0], rel=6e-3, abs=6e-4)
        assert "then" in tab.page.locator("#contact h2").inner_text()
        with tab.page.expect_download() as file:
            tab.page.keyboard.press("c")
        rows = list(csv.DictReader(file.value.path().read_text(encoding="utf-8").splitlines()))
        times = [float(row["contact_t [s]"]) for row in rows if row["contact_t [s]"]]
        assert set(times) <= set(told)
        assert len(set(times)) > 2
        for row in rows:
            if row["contact_t [s]"]:
                t = float(row["contact_t [s]"])
                assert abs(t - float(row["t [s]"])) <= 0.5
                speed = told[t][0]
                np.testing.assert_allclose([float(row[f"contact_speed.{name}"]) for name in names], speed, rtol=1e-6)
                assert float(row["contact_margin.link1"]) == pytest.approx(0.5 - speed[0], abs=1e-6)
                assert row["contact_margin.link2"] == ""
                assert row["contact_worst"] == "link1"
        tab.page.keyboard.press("l")
        tab.until("!diag.state.paused && diag.contact.shown && diag.contact.shown.t === diag.contact.t")
        assert tab.said == []
    finally:
        tab.close()
        one.stop()


def test_the_worst_status_stands_where_it_is_seen_at_once(chromium):
    """In the head, at 1280 × 720, and under what the page says of itself: why no state comes, or no longer."""
    text, refused = chain(["one", "two"]), "robot_description refused: parameter 'alarm.joints' names 'elbow'"
    model = dd.load_urdf(text)
    robot = Robot(model)
    show = Show("/late", robot.take)
    own = "diag_dynamics: "
    show.tell(
        [
            {"level": 1, "name": f"{own}rates", "message": "a gap", "values": {}},
            {"level": 2, "name": f"{own}model", "message": refused, "values": {}},
        ]
    )
    one = PageServer(lambda: [show])
    one.start()
    tab = Tab(chromium, (1280, 720), "light")
    try:
        tab.page.goto(one.address, wait_until="domcontentloaded")
        tab.until("diag.state.word === 'Waiting' && diag.state.worst")
        seen = ".banner", ".worst", ".diagnostics"
        for place in seen:
            tab.until(f"document.querySelector('{place}').textContent.includes(\"{refused}\")")
            assert tab.page.locator(place).is_visible()
        show.use(dd.DiagonalDynamics(model), scene_of(model, text), None)
        tab.until("diag.state.ready && diag.state.word === 'Live' && diag.state.level === 'bad'")
        bad = tab.ask("getComputedStyle(document.documentElement).getPropertyValue('--bad').trim()")
        for place in (".worst", ".pill"):
            assert (
                tab.ask(f"getComputedStyle(document.querySelector('{place}')).getPropertyValue('--tone').trim()") == bad
            )
            box = tab.page.locator(place).bounding_box()
            assert box["y"] + box["height"] < 720 / 4
        tab.until("diag.state.word === 'Live' && document.querySelector('.banner').hidden")
        robot.silent.set()
        tab.until("diag.state.word === 'Stale' && !document.querySelector('.banner').hidden")
        assert refused in tab.page.locator(".banner").inner_text()
        assert tab.cut_off() == []
        show.tell([{"level": 0, "name": f"{own}model", "message": "as expected", "values": {}}])
        robot.silent.clear()
        tab.until("diag.state.level === 'good' && document.querySelector('.worst').hidden")
        assert [text for text in tab.said if "503" not in text] == []  # of a robot of which nothing was known
    finally:
        tab.close()
        one.stop()


def test_comes_back_after_a_restart_of_the_server(chromium, panda):
    """By itself, on the same port; what was stored is still there. Meanwhile it says so."""
    show = panda[1]
    first = PageServer(lambda: [show])
    first.start()
    tab = Tab(chromium, (800, 600))
    try:
        tab.open(first.address)
        stored = tab.until("diag.state.stored > 20 && diag.state.stored")
        first.stop()
        tab.until("diag.state.word === 'Disconnected' && !document.querySelector('.banner').hidden")
        second = PageServer(lambda: [show], port=first.server_port)
        second.start()
        try:
            tab.until(f"diag.state.word === 'Live' && diag.state.stored > {stored}")
        finally:
            second.stop()
        refused = [
            text for text in tab.said if "ERR_" not in text
        ]  # what the browser itself says of a server that is gone
        assert refused == []
        assert tab.asked <= {first.address.rstrip("/")}
    finally:
        tab.close()


# --- One page, as people leave it open ---


@pytest.fixture(scope="module")
def tab(chromium, server):
    one = Tab(chromium)
    one.open(server.address)
    yield one
    assert not one.said
    assert one.asked <= {server.address.rstrip("/"), "data://", "blob://"}, "a request left the machine"
    assert one.ask("diag.errors") == []
    one.close()


@pytest.fixture
def live(tab):
    """The tab as it is when nobody has touched it."""
    tab.page.keyboard.press("Escape")
    tab.page.keyboard.press("l")
    tab.page.keyboard.press("1")
    tab.page.mouse.move(5, 5)
    tab.until("diag.state.word === 'Live' && !diag.state.paused && diag.state.namespace === '/arm'")
    return tab


def paused(tab, robot):
    """Have the page stop; returns what it shows, and an evaluation of the state at that time."""
    before = tab.ask("diag.values.t")
    tab.until(f"diag.values.t > {before!r} + 0.5")
    tab.page.keyboard.press(" ")
    tab.until("diag.state.paused && diag.values.t === diag.state.now")
    tab.drawn()  # plots and table, which are drawn less often than the robot, may be of a state before it until then
    values = tab.ask("diag.values")
    assert values["t"] == tab.ask("diag.state.now")
    q, qd, tau, external = robot.state(values["t"] - robot._first_stamp)
    return values, (q, qd, tau, external), dd.DiagonalDynamics(robot.model).evaluate(q, qd, tau)


def test_numbers_are_those_of_the_state(live, panda):
    """Of frames, of legends and of the table, against an evaluation of our own at the time that the page shows."""
    robot, _ = panda
    values, (q, qd, tau, external), s = paused(live, robot)
    dyn = dd.DiagonalDynamics(robot.model)
    expected = {
        **{"q": q, "qd": qd, "effort": tau, "nu": s.nu, "coriolis": s.coriolis, "gravity": s.gravity},
        **{"D": s.articulated_inertia, "K": [s.kinetic_energy], "link_energy": s.link_energy},
        **{"external_torque": external, "gravity_torque": dyn.gravity_torque(q)},
    }
    for name, wanted in expected.items():
        scale = max(np.abs(wanted).max(), 1e-3)  # times of double precision are 0.2 µs apart, and states with them
        np.testing.assert_allclose(values[name], wanted, rtol=1e-4, atol=1e-4 * scale, err_msg=name)
    plots = live.ask("diag.plots")
    names = robot.model.dof_names
    for plot, wanted in (
        ("energy", s.energy_share),
        ("exchange", s.nu * s.coriolis),
        ("inertia", s.articulated_inertia),
    ):
        drawn = [plots[plot]["values"][name] for name in names]
        np.testing.assert_allclose(drawn, wanted, rtol=1e-3, atol=1e-4 * np.abs(wanted).max())
        for name, number in zip(names, drawn, strict=True):
            assert read(plots[plot]["texts"][name]) == pytest.approx(number, rel=0.06, abs=1e-3 * np.abs(wanted).max())
    limits = robot.model.effort_limit
    drawn = [plots["torque"]["values"][name] for name in names]
    np.testing.assert_allclose(drawn, 100.0 * tau / limits, rtol=1e-3, atol=1e-2)
    assert 0.0 <= plots["work"]["values"]["|νᵀC| / (|ν||C|)"] < 1e-12
    rows = live.page.locator(".joints tbody tr").all_inner_texts()
    assert len(rows) == robot.model.nv
    largest = int(np.argmax(s.energy_share))
    assert read(rows[largest].split()[1]) == pytest.approx(s.energy_share[largest], rel=0.01)


def read(text):
    """A number as the page writes it."""
    return float(text.replace("−", "-"))


def test_mobility_and_effective_mass_of_the_link(live, panda):
    """1/(uᵀ J M⁻¹Jᵀ u) along the velocity of the link that was clicked."""
    robot, _ = panda
    live.page.keyboard.press(" ")  # what stands still can be hit
    live.until("diag.state.paused && diag.values.t === diag.state.now")
    place = live.until("diag.where('panda_link6')")
    live.ask("document.querySelector('.joints').dataset.before = 'yes'")
    live.page.mouse.click(place["x"], place["y"])
    live.page.keyboard.press(" ")
    live.until("diag.state.selected.link === 'panda_link6' && diag.marks && diag.marks.link === 'panda_link6'")
    # States on their way are of the link before. With those of this one comes a layout, and with it a new table.
    live.until("!document.querySelector('.joints').dataset.before")
    live.until("diag.values.twist[0] === diag.values.twist[0]")
    _, (q, qd, _, _), _ = paused(live, robot)
    marks = live.until("diag.marks")
    dyn = dd.DiagonalDynamics(robot.model)
    velocity = dyn.link_velocity(q, qd, "panda_link6", frame="world")[:3]
    mobility = dyn.operational_inverse_inertia(q, "panda_link6", frame="world")[:3, :3]
    axes = np.linalg.eigvalsh(mobility)
    u = velocity / np.linalg.norm(velocity)
    assert marks["speed"] == pytest.approx(np.linalg.norm(velocity), rel=1e-3)
    np.testing.assert_allclose(sorted(marks["mobilities"]), axes, rtol=1e-3)
    assert marks["mass"] == pytest.approx(1.0 / (u @ mobility @ u), rel=1e-2)
    assert live.page.locator(".details").is_visible()
    assert "panda_link6" in live.page.locator(".details h2").inner_text()


def ramp(part):
    """The colour at a part of the scale, 0 to 255."""
    x = np.clip(part, 0.0, 1.0) * (len(RAMP) - 1)
    return np.array([np.interp(x, np.arange(len(RAMP)), RAMP[:, c]) for c in range(3)])


@pytest.mark.parametrize("key, by", [("1", "share"), ("2", "energy"), ("3", "torque"), ("4", "external")])
def test_links_have_the_colours_of_their_numbers(live, panda, key, by):
    """As the page computes them, and as they come out of the canvas: the hue of the light, whatever the shade."""
    robot, _ = panda
    live.page.keyboard.press(key)
    values, _, _ = paused(live, robot)
    live.until(f"diag.colours.by === '{by}'")
    told = live.ask("diag.colours")
    names, model = list(told["links"]), robot.model
    of_dof = {"share": 50.0 * np.square(values["nu"]) / values["K"][0], "external": np.abs(values["external_torque"])}
    of_dof["torque"] = 100.0 * np.abs(np.array(values["effort"]) / model.effort_limit)
    for k in range(1, 8):  # link k is moved by joint k
        name = f"panda_link{k}"
        number = values["link_energy"][model.link_names.index(name)] if by == "energy" else of_dof[by][k - 1]
        rgb = [int(told["links"][name][n : n + 2], 16) for n in (1, 3, 5)]
        np.testing.assert_allclose(rgb, ramp(number / told["end"]), atol=1.01)
    if by != "energy":
        assert told["links"]["panda_link0"] == UNKNOWN
    seen = 0
    png_of(live.page)  # for which the robot is drawn at once: else a slow machine shows it as it was some time before
    live.drawn()
    picture = Image.open(io.BytesIO(live.page.screenshot())).convert("RGB")
    for name in names:
        place = live.ask(f"diag.where('{name}')")
        wanted = [int(told["links"][name][n : n + 2], 16) / 255 for n in (1, 3, 5)]
        hue, saturation, _ = colorsys.rgb_to_hsv(*wanted)
        if place is None or saturation < 0.25:
            continue
        pixel = [c / 255 for c in picture.getpixel((round(place["x"]), round(place["y"])))]
        found, strength, _ = colorsys.rgb_to_hsv(*pixel)
        if strength > 0.12:  # not where the light is mirrored
            seen += abs((found - hue + 0.5) % 1.0 - 0.5) < 0.08
    assert seen >= 3


def png_of(page):
    """The picture of what is seen that the page makes."""
    with page.expect_download() as png:
        page.keyboard.press("p")
    return Image.open(png.value.path()).convert("RGB")


def numbers_seen(page):
    """Header and rows of the CSV of what is seen."""
    with page.expect_download() as file:
        page.keyboard.press("c")
    lines = file.value.path().read_text(encoding="utf-8").splitlines()
    return lines[0].split(","), np.array([[float(cell or "nan") for cell in line.split(",")] for line in lines[1:]])


def test_keys_scrub_and_cursor(live):
    page = live.page
    page.keyboard.press("+")
    live.until("diag.state.window[1] - diag.state.window[0] === 15")
    page.keyboard.press("-")
    live.until("diag.state.last - diag.state.first > 2")
    strip = page.locator(".timeline").bounding_box()
    page.mouse.move(strip["x"] + 0.7 * strip["width"], strip["y"] + 5)
    page.mouse.down()
    page.mouse.move(strip["x"] + 0.4 * strip["width"], strip["y"] + 5)
    page.mouse.up()
    state = live.until("diag.state.paused && diag.state")
    assert state["word"] == "Paused"
    first, ends = state["first"], (state["window"][1], state["last"])  # when it was paused, and by now
    assert first + 0.4 * (ends[0] - first) - 0.2 < state["now"] < first + 0.4 * (ends[1] - first) + 0.2
    page.keyboard.press("ArrowRight")
    stepped = live.until(f"diag.state.now > {state['now']!r} && diag.state.now")
    times = numbers_seen(page)[1][:, 0]
    assert stepped == times[np.argmin(abs(times - state["now"])) + 1]
    card = page.locator("#plot-exchange .u-over").bounding_box()
    page.mouse.move(card["x"] + 0.9 * card["width"], card["y"] + 20)
    places = (
        "[...document.querySelectorAll('.u-over')].slice(0, 6).map((over) => [over, over.querySelector('.cursor')])"
    )
    parts = f"{places}.filter(([, c]) => c && !c.hidden).map(([o, c]) => new DOMMatrix(c.style.transform).e / o.clientWidth)"
    live.until(f"{parts}.filter((part) => Math.abs(part - 0.9) < 0.02).length === 6")  # all that are in sight
    page.keyboard.press("?")
    assert page.locator("dialog.help").is_visible()
    page.keyboard.press("?")
    page.keyboard.press("t")
    assert live.ask("document.documentElement.dataset.theme") == "light"
    page.keyboard.press("t")
    page.keyboard.press("j")
    live.until("diag.state.selected.dof === 0 && !document.querySelector('.details').hidden")


def test_picture_and_numbers_of_what_is_seen(live, panda):
    values, _, _ = paused(live, panda[0])
    header, rows = numbers_seen(live.page)
    last = rows[-1]
    assert header[0] == "t [s]"
    assert last[0] == values["t"]
    for k, name in enumerate(panda[0].model.dof_names):
        assert last[header.index(f"nu.{name}")] == pytest.approx(values["nu"][k], rel=1e-6)
    picture = png_of(live.page)
    assert picture.size == (1280, 720)
    seen = Image.open(io.BytesIO(live.page.screenshot())).convert("RGB")
    apart = np.abs(np.asarray(picture, dtype=float) - np.asarray(seen, dtype=float)).mean(axis=2)
    assert (apart > 40).mean() < 0.06, "the picture is not what is seen"


def test_says_what_cannot_be_believed(live, panda):
    robot, _ = panda
    robot.told = {"estimated": True, "no_result": True}
    live.until("diag.state.notes.includes('velocities estimated') && diag.state.level === 'warn'")
    live.until("diag.state.notes.includes('external torque not valid')")
    live.until("[...document.querySelectorAll('.joints td:last-child b')].every((b) => b.textContent === '–')")
    robot.told = {}
    live.until("diag.state.notes.length === 0 || diag.state.notes[0] === 'contact'")
    robot.silent.set()
    live.until("diag.state.word === 'Stale' && document.querySelector('.stage').classList.contains('dim')")
    robot.silent.clear()
    live.until("diag.state.word === 'Live'")


def test_several_robots(live, ur5):
    live.page.keyboard.press("r")
    live.until("diag.state.namespace === '/other' && diag.state.ready && diag.state.robot.startsWith('ur5')")
    live.until(f"document.querySelectorAll('.joints tbody tr').length === {ur5[0].model.nv}")
    live.page.keyboard.press("r")
    live.until("diag.state.namespace === '/arm' && diag.state.ready")


def test_diagnostics_in_words(live):
    live.until("document.querySelector('.diagnostics').innerText.includes('a gap of 0.2 s')")
    live.until("/states\\/s received/.test(document.querySelector('.pulse').textContent)")


def test_no_text_is_cut_off(live):
    try:
        for width, height in SIZES:
            live.page.set_viewport_size({"width": width, "height": height})
            live.page.keyboard.press("Escape")
            assert live.cut_off() == [], f"{width} x {height}"
            live.page.keyboard.press("j")
            live.until("!document.querySelector('.details').hidden")
            assert live.cut_off() == [], f"{width} x {height}, with details"
    finally:
        live.page.set_viewport_size({"width": 1280, "height": 720})


def test_show_of_is_what_a_page_gets(server):
    """The demo's own way to a page, without a browser."""
    assert show_of(str(find_urdf("ur5")), RATE, "/demo").about()["name"] == "/demo"


class _AsFastAsItGoes(BaseHTTPRequestHandler):
    """A server that sends frames, 50 to a second of their stamps, without a pause until there are enough.

    It sends none twice. A page that stands still for seconds, as on a busy machine, takes the stream for lost and comes
    back, as it does when the stream ends; what it stores would begin anew if time went back then.
    """

    layout, row, numbers, enough = b"", None, itertools.count(), threading.Event()

    def log_message(self, *_):
        pass

    def do_GET(self):
        path = self.path.partition("?")[0]
        answers = {
            "/robots": json.dumps([{"name": "/fast", "robot": "fast", "alive": True}]).encode(),
            "/layout": self.layout,
            **{f"/{name}": (STATIC / name).read_bytes() for name in ("page.js", "page.css")},
            "/": (STATIC / "index.html").read_bytes(),
        }
        self.send_response(200 if path in answers or path == "/stream" else 404)
        kind = {"/": "text/html", "/page.js": "text/javascript", "/page.css": "text/css"}.get(
            path, "application/octet-stream"
        )
        self.send_header("Content-Type", kind)
        self.end_headers()
        self.wfile.write(answers.get(path, b""))
        if path == "/stream":
            self._stream()

    def _stream(self):
        self.wfile.write(struct.pack("<IB", len(self.layout), 0) + self.layout)
        size = 8 + 4 * len(self.row)
        while not self.enough.is_set():
            stamps = [1000.0 + 0.02 * k for k in itertools.islice(self.numbers, 100)]
            packets = [struct.pack("<IBd", size, 1, stamp) + self.row.tobytes() for stamp in stamps]
            self.wfile.write(b"".join(packets))


def test_memory_is_bounded_over_ten_minutes_sent_at_once(chromium):
    """Five minutes are kept, and the heap does not grow with what came before."""
    model = dd.load_urdf(chain(["one", "two", "three"]))
    maker = FrameMaker(dd.DiagonalDynamics(model))
    _AsFastAsItGoes.layout = json.dumps(maker.layout.to_json(scene_of(model, chain(["one", "two", "three"])))).encode()
    _AsFastAsItGoes.row = np.full(maker.layout.size, 0.5, dtype="<f4")
    server = ThreadingHTTPServer(("127.0.0.1", 0), _AsFastAsItGoes)
    server.daemon_threads = True
    threading.Thread(target=server.serve_forever, daemon=True).start()
    tab = Tab(chromium, (800, 600))
    try:
        tab.page.goto(f"http://127.0.0.1:{server.server_port}/", wait_until="domcontentloaded")
        tab.until("diag.state.frames >= 15000")
        session = tab.page.context.new_cdp_session(tab.page)
        half = heap(session)
        tab.until("diag.state.frames >= 30000")
        _AsFastAsItGoes.enough.set()
        state = tab.ask("diag.state")
        assert state["stored"] == 15_000
        assert state["last"] - state["first"] > 299.97  # and more where some were lost with a stream
        assert state["bytes"] <= 15_000 * (8 + 4 * maker.layout.size)
        assert heap(session) < half + 5e6
    finally:
        tab.close()
        server.shutdown()
        server.server_close()


def heap(session):
    """Bytes of the page's heap, garbage collected."""
    session.send("HeapProfiler.collectGarbage")
    return session.send("Runtime.getHeapUsage")["usedSize"]
