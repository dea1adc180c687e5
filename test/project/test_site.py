# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The site: built without a warning, complete, and without a request to anybody else, in a browser too."""

import http.server
import re
import shutil
import subprocess
import sys
import threading
from functools import partial
from html.parser import HTMLParser
from pathlib import Path

import pytest

import diag_dynamics as dd

pytestmark = [pytest.mark.full]

ROOT = Path(__file__).parents[2]
sphinx_inventory = pytest.importorskip("sphinx.util.inventory", reason="Sphinx is not installed")

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """Build the site as `make docs` does; a warning fails."""
    folder = tmp_path_factory.mktemp("site") / "html"
    done = subprocess.run(
        [sys.executable, ROOT / "docs/site/build.py", folder], capture_output=True, text=True, cwd=ROOT
    )
    assert done.returncode == 0 and not done.stderr.strip(), done.stderr
    return folder


def test_every_page_is_there(site):
    pages = [path.relative_to(ROOT) for path in (ROOT / "docs").rglob("*.md")]
    assert len(pages) > 30
    assert [str(page) for page in pages if not (site / page).with_suffix(".html").is_file()] == []
    assert 'url=docs/index.html"' in (site / "index.html").read_text(encoding="utf-8")


def test_every_public_name_is_documented(site):
    """With a place of its own, by Sphinx's own list."""
    inventory = sphinx_inventory.InventoryFile.loads((site / "objects.inv").read_bytes(), uri="")
    names = {
        name
        for kind in ("py:class", "py:function", "py:exception", "py:module")
        for name in inventory.data.get(kind, {})
    }
    assert {f"diag_dynamics.{name}" for name in dd.__all__} - names == set()
    methods = set(inventory.data["py:method"])
    for method in ("evaluate", "evaluate_batch", "jacobian", "forward_dynamics", "factors"):
        assert f"diag_dynamics.DiagonalDynamics.{method}" in methods


def test_docstrings_are_read_as_they_were_meant(site):
    """No sentence is taken for a type or a parameter, and named tuples do not number their fields."""
    for page in (site / "docs" / "api").glob("*.html"):
        text = page.read_text(encoding="utf-8")
        assert ">Type<" not in text and "Alias for field" not in text, page.name
        told = re.findall(r"<li><p><strong>(.*?)</strong>", text)
        assert [name for name in told if not re.fullmatch(r"[*\w]+(,(\s|\u200b)*[*\w]+)*", name)] == [], page.name


class Loads(HTMLParser):
    """Addresses that a browser fetches by itself when it opens a page: not those of links to follow."""

    def __init__(self):
        super().__init__()
        self.found = []

    def handle_starttag(self, tag, attrs):
        given = dict(attrs)
        if tag != "a" and not (tag == "link" and given.get("rel") in ("next", "prev", "search", "index", "canonical")):
            self.found += [
                given[name] for name in ("src", "href", "srcset", "data", "poster", "action") if given.get(name)
            ]
        self.found += re.findall(r"url\(([^)]*)\)", given.get("style") or "")


def is_outside(address):
    return re.match(r"\s*[\"']?(?:\w+:)?//", address) is not None


def test_nothing_is_loaded_from_elsewhere(site):
    """No page, style or script names an address elsewhere that a browser would fetch."""
    pages = sorted(site.rglob("*.html"))
    assert len(pages) > 30
    for page in pages:
        loads = Loads()
        loads.feed(page.read_text(encoding="utf-8"))
        assert loads.found or page == site / "index.html"
        assert [address for address in loads.found if is_outside(address)] == [], page
    for style in site.rglob("*.css"):
        text = re.sub(r"/\*.*?\*/", "", style.read_text(encoding="utf-8"), flags=re.S)
        fetched = re.findall(r"url\(\s*([^)]*)\)|@import\s+([^;]*)", text)
        assert [one for pair in fetched for one in pair if is_outside(one)] == [], style
    for script in site.rglob("*.js"):
        if script.name != "searchindex.js":  # the words of all pages
            code = re.sub(r"/\*.*?\*/|^\s*//.*$", "", script.read_text(encoding="utf-8"), flags=re.S | re.M)
            addresses = re.findall(r"[\"'`](?:https?:)?//[^\"'`]+", code)
            assert [one for one in addresses if "w3.org" not in one] == [], script


def test_an_address_elsewhere_is_found():
    """The test before this one can fail."""
    loads = Loads()
    loads.feed(
        '<script src="https://cdn.example/mathjax.js"></script><img src="/own.png"><a href="https://a.example">a</a>'
    )
    assert [address for address in loads.found if is_outside(address)] == ["https://cdn.example/mathjax.js"]


@pytest.fixture(scope="module")
def served(site):
    """Serve the site, as any web server would, and return its address."""

    class Quiet(http.server.SimpleHTTPRequestHandler):
        def log_message(self, *_):
            pass

    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=site))
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    yield f"http://127.0.0.1:{server.server_port}"
    server.shutdown()
    server.server_close()
    thread.join()


@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium is installed")
def test_a_browser_asks_nobody_else(served):
    """Pages come without an error, pictures and formulas are drawn, the search finds, and no request leaves."""
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    asked, wrong = [], []
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        page = browser.new_page()
        page.set_default_timeout(120_000)  # only a failing test waits so long [ms]
        page.on("request", lambda request: asked.append(request.url))
        page.on("requestfailed", lambda request: wrong.append(request.url))
        page.on("response", lambda answer: wrong.append(answer.url) if answer.status >= 400 else None)
        page.on("pageerror", lambda error: wrong.append(str(error)))
        page.goto(f"{served}/index.html")
        page.wait_for_url("**/docs/index.html")
        for name in ("concepts", "gallery", "tutorial", "api/dynamics", "parameters"):
            page.goto(f"{served}/docs/{name}.html")
            assert (
                page.evaluate("[...document.images].filter(i => !(i.complete && i.naturalWidth > 0)).map(i => i.src)")
                == []
            )
            heights = page.evaluate("[...document.querySelectorAll('math')].map(m => m.getBoundingClientRect().height)")
            assert all(height > 5 for height in heights)
            assert (name != "concepts") or len(heights) >= 15
            wide = page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth")
            assert wide <= 0, f"{name} is wider than the window"
        page.goto(f"{served}/docs/gallery.html")
        page.get_by_role("link", name="the report of a recorded run", exact=True).click()
        page.wait_for_selector("canvas")  # the run itself, not a download of it
        page.goto(f"{served}/search.html?q=reflected_mass")
        page.wait_for_selector("#search-results li a")
        page.wait_for_load_state("networkidle")  # results ask for what they show: a request that is cut off has failed
        browser.close()
    assert len(asked) > 20 and not wrong, wrong
    assert [url for url in asked if not url.startswith((served, "data:"))] == []
