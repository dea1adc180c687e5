# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A real browser: Chromium as the system has it, driven by Playwright."""

import os
import shutil
import time
from contextlib import contextmanager
from urllib.parse import urlsplit

import pytest

OPTIONS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
"""Of Chromium: in a container, and without a graphics card."""

REQUIRED = os.environ.get("DIAG_DYNAMICS_REQUIRE_BROWSER") == "1"

PATIENCE = 120.0
"""How long a page may take to get somewhere [s]: machines that test are slow. Only a failing test waits so long."""


def require():
    """Playwright's sync API and the path of Chromium; skips where one of them is not there."""
    path = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        sync_playwright = None
    missing = [name for name, there in (("chromium", path), ("playwright", sync_playwright)) if not there]
    if missing:
        (pytest.fail if REQUIRED else pytest.skip)(f"not installed: {', '.join(missing)}")
    return sync_playwright, path


@contextmanager
def browser():
    """Chromium."""
    sync_playwright, path = require()
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=path, args=OPTIONS)
        try:
            yield chromium
        finally:
            chromium.close()


class Tab:
    """A tab, and all that it says and asks for.

    Attributes
    ----------
    page : playwright's Page
    said : list of str
        Errors and warnings on its console.
    asked : set of str
        Schemes and hosts of all requests.
    """

    def __init__(self, browser, size=(1280, 720), scheme="dark"):
        width, height = size
        self._context = browser.new_context(
            viewport={"width": width, "height": height}, color_scheme=scheme, accept_downloads=True
        )
        self._context.set_default_timeout(1000.0 * PATIENCE)
        self.page = self._context.new_page()
        self.said, self.asked = [], set()
        self.page.on("console", lambda message: self._take(message))
        self.page.on("pageerror", lambda error: self.said.append(str(error)))
        self.page.on("request", lambda request: self.asked.add("{0.scheme}://{0.netloc}".format(urlsplit(request.url))))

    def _take(self, message):
        ours = "GPU stall" not in message.text  # the software renderer's own
        if message.type in ("error", "warning") and ours:
            self.said.append(message.text)

    def open(self, url):
        """Open a page, and wait until it shows a robot."""
        self.page.goto(url, wait_until="domcontentloaded")
        self.until("diag.state.ready")

    def ask(self, expression):
        """The value of an expression in the page."""
        return self.page.evaluate(expression)

    def drawn(self):
        """Wait until the page has drawn what it was told to show, which it does in its next frame."""
        self.ask("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")

    def until(self, expression, patience=PATIENCE):
        """Wait until an expression is true in the page; returns its value.

        Playwright's own way to wait evaluates text in the page, which the page's policy forbids.
        """
        end = time.monotonic() + patience
        while not (value := self.ask(f"(() => {{ const diag = window.diag; return diag && ({expression}); }})()")):
            if time.monotonic() > end:
                state = self.ask("window.diag ? JSON.stringify(window.diag.state) : 'no page'")
                raise AssertionError(f"waited {patience:g} s for {expression}: {state}; {self.said}")
            self.page.wait_for_timeout(20)
        return value

    def cut_off(self, patience=PATIENCE):
        """Texts of which a part can neither be seen nor be scrolled to, once the page is laid out."""
        end = time.monotonic() + patience
        while (found := self.ask(f"({CUT_OFF})()")) and time.monotonic() < end:
            self.page.wait_for_timeout(50)
        return found

    def out_of_panels(self, patience=PATIENCE):
        """Plots that reach out of their panels, and legends of more than two lines, once the page is laid out."""
        end = time.monotonic() + patience
        while (found := self.ask(f"({OUT_OF_PANELS})()")) and time.monotonic() < end:
            self.page.wait_for_timeout(50)
        return found

    def close(self):
        """Close it."""
        self._context.close()


OUT_OF_PANELS = """() => {
  const found = [];
  for (const card of document.querySelectorAll(".card")) {
    const panel = card.getBoundingClientRect();
    for (const part of card.querySelectorAll(".uplot, canvas")) {
      const box = part.getBoundingClientRect();
      if (box.bottom > panel.bottom + 0.5 || box.right > panel.right + 0.5) found.push(`a plot out of ${card.id}`);
    }
    const plot = card.querySelector(".plot");
    if (!plot) continue;
    if (plot.getBoundingClientRect().bottom > panel.bottom + 0.5) found.push(`the plot's place out of ${card.id}`);
    const legend = card.querySelector(".legend");
    const line = parseFloat(getComputedStyle(legend).lineHeight);
    if (legend.parentElement.clientHeight > 2.4 * line) found.push(`a legend of many lines in ${card.id}`);
  }
  return found;
}"""
"""Plots of which a part lies over what is below."""

CUT_OFF = """() => {
  const found = [];
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (walker.nextNode()) {
    const node = walker.currentNode;
    if (!node.data.trim() || ["SCRIPT", "STYLE", "OPTION"].includes(node.parentElement.tagName)) continue;
    const range = document.createRange();
    range.selectNodeContents(node);
    const rect = range.getBoundingClientRect();
    if (!rect.width || getComputedStyle(node.parentElement).visibility === "hidden") continue;
    let [left, right] = [0, document.documentElement.clientWidth];
    let [top, bottom] = [-Infinity, Infinity];
    for (let box = node.parentElement; box; box = box.parentElement) {
      const { overflowX, overflowY } = getComputedStyle(box);
      const own = box.getBoundingClientRect();
      if (overflowX !== "visible") [left, right] = [Math.max(left, own.left), Math.min(right, own.right)];
      const cuts = overflowY === "hidden" || overflowY === "clip";
      if (cuts) [top, bottom] = [Math.max(top, own.top), Math.min(bottom, own.bottom)];
      if (overflowY === "auto" || overflowY === "scroll") break;  // what is below can be scrolled to
    }
    const room = 1.5;
    if (rect.left < left - room || rect.right > right + room || rect.top < top - room || rect.bottom > bottom + room)
      found.push(`${node.data.trim()} in ${node.parentElement.className || node.parentElement.tagName}`);
  }
  const wide = document.documentElement.scrollWidth - document.documentElement.clientWidth;
  if (wide > 1) found.push(`the page is ${wide} px too wide`);
  return found;
}"""
"""Texts of a page of which a part cannot be seen, nor be scrolled to."""
