# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The page in Chromium. One smoke test is of the gate; the functions of the page have tests of their own in web/test."""

import time

import numpy as np
import pytest

import diag_dynamics as dd
import page_fixture
from browser import Tab, browser
from diag_dynamics.page.frames import Seen, States
from diag_dynamics.page.scene import scene_of
from diag_dynamics.page.server import PageServer
from diag_dynamics.page.show import Show, Taken

pytestmark = pytest.mark.browser


@pytest.fixture(scope="module")
def chromium():
    with browser() as one:
        yield one


def still(dynamics):
    """The state of page_fixture, as if it had come just now."""
    s = dynamics.evaluate(page_fixture.Q, page_fixture.QD, page_fixture.EFFORT)
    zero = np.zeros((1, 2))
    seen = Seen([True], zero, zero, np.zeros(1), [False])
    states = States.of(time.time(), page_fixture.Q, page_fixture.QD, page_fixture.EFFORT, s)
    return Taken(states, seen, received=time.monotonic())


@pytest.fixture
def serve():
    """Serve shows in this process; returns a function that takes them and returns their server."""
    servers = []

    def start(*shows, **options):
        servers.append(PageServer(lambda: shows, **options))
        servers[-1].start()
        return servers[-1]

    yield start
    for server in servers:
        server.stop()


def test_the_page_shows_the_kinetic_energy_of_the_state(chromium, serve):
    """The page opens, its console says nothing, and K is 6.5 J."""
    model = dd.load_urdf(page_fixture.ARM)
    show = Show("/arm", still)
    show.use(dd.DiagonalDynamics(model), scene_of(model, page_fixture.ARM), None)
    address = serve(show).address
    with Tab(chromium, (640, 480)) as tab:
        tab.open(address)
        tab.until("document.querySelector('.headline b').textContent === '6.50 J'")
        assert tab.said == []
        assert tab.asked == {address.rstrip("/")}
