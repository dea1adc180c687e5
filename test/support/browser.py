# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A browser: the system's Chromium, driven by Playwright."""

import shutil
from contextlib import contextmanager
from urllib.parse import urlsplit

import pytest

from limits import HANG

OPTIONS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
"""Chromium's options in a container without a graphics card."""


def require():
    """Return Playwright's sync API and the path of Chromium; fail where one of them is missing."""
    path = next(
        filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None
    )
    if path is None:
        pytest.fail(
            "Chromium is not installed. apt-get install --no-install-recommends chromium",
            pytrace=False,
        )
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        pytest.fail("Playwright is not installed. make setup-tests", pytrace=False)
    return sync_playwright, path


@contextmanager
def browser():
    """Start Chromium, and end it afterwards."""
    sync_playwright, path = require()
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=path, args=OPTIONS)
        try:
            yield chromium
        finally:
            chromium.close()


class Tab:
    """A tab with a record of its console and of its requests.

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
        self._context.set_default_timeout(1000.0 * HANG)
        self.page = self._context.new_page()
        self.said = []
        self.asked = set()
        self.page.on("console", self._record)
        self.page.on("pageerror", lambda error: self.said.append(str(error)))
        self.page.on(
            "request",
            lambda request: self.asked.add("{0.scheme}://{0.netloc}".format(urlsplit(request.url))),
        )

    def __enter__(self):
        """Return the tab."""
        return self

    def __exit__(self, *_):
        """Close the tab."""
        self._context.close()

    def _record(self, message):
        is_renderers = "GPU stall" in message.text  # a remark of the software renderer
        if message.type in ("error", "warning") and not is_renderers:
            self.said.append(message.text)

    def open(self, url):
        """Open a page, and wait until it shows a robot."""
        self.page.goto(url, wait_until="domcontentloaded")
        self.until("diag.state.ready")

    def ask(self, expression):
        """Return the value of an expression in the page."""
        return self.page.evaluate(expression)

    def drawn(self):
        """Wait until the page has drawn its next frame."""
        self.ask("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")

    def until(self, expression, timeout=HANG):
        """Wait in the page until an expression is true; return its value.

        Playwright's own way to wait evaluates text in the page, which the page's policy forbids.
        """
        result, state = self.ask(
            f"""async () => {{
              const end = performance.now() + {1000.0 * timeout};
              for (;;) {{
                const diag = window.diag;
                const value = diag && ({expression});
                if (value) return [value, null];
                if (performance.now() > end)
                  return [null, diag ? JSON.stringify(diag.state) : "no page"];
                await new Promise((again) => setTimeout(again, 20));
              }}
            }}"""
        )
        assert state is None, f"waited {timeout:g} s for {expression}: {state}; {self.said}"
        return result

    def cut_off(self):
        """Return texts that are cut off and cannot be scrolled to, after the page has its
        layout.
        """
        return self.ask(
            f"""async () => {{
              const end = performance.now() + {1000.0 * HANG};
              let found = [];
              while ((found = ({CUT_OFF})()).length && performance.now() < end)
                await new Promise((again) => setTimeout(again, 50));
              return found;
            }}"""
        )


CUT_OFF = """() => {
  const found = [];
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (walker.nextNode()) {
    const node = walker.currentNode;
    if (!node.data.trim()) continue;
    if (["SCRIPT", "STYLE", "OPTION"].includes(node.parentElement.tagName)) continue;
    const range = document.createRange();
    range.selectNodeContents(node);
    const rect = range.getBoundingClientRect();
    if (!rect.width || getComputedStyle(node.parentElement).visibility === "hidden") continue;
    let [left, right] = [0, document.documentElement.clientWidth];
    let [top, bottom] = [-Infinity, Infinity];
    for (let box = node.parentElement; box; box = box.parentElement) {
      const { overflowX, overflowY } = getComputedStyle(box);
      const own = box.getBoundingClientRect();
      if (overflowX !== "visible")
        [left, right] = [Math.max(left, own.left), Math.min(right, own.right)];
      const cuts = overflowY === "hidden" || overflowY === "clip";
      if (cuts) [top, bottom] = [Math.max(top, own.top), Math.min(bottom, own.bottom)];
      // what is below can be scrolled to
      if (overflowY === "auto" || overflowY === "scroll") break;
    }
    const room = 1.5;
    const beside = rect.left < left - room || rect.right > right + room;
    if (beside || rect.top < top - room || rect.bottom > bottom + room)
      found.push(
        `${node.data.trim()} in ${node.parentElement.className || node.parentElement.tagName}`
      );
  }
  const wide = document.documentElement.scrollWidth - document.documentElement.clientWidth;
  if (wide > 1) found.push(`the page is ${wide} px too wide`);
  return found;
}"""
"""Texts of a page of which a part cannot be seen, nor be scrolled to."""
