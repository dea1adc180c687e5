# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Excerpts of search results for pages that are opened as files, where browsers do not let Sphinx fetch pages."""

import json
from pathlib import Path

from lxml import html


def excerpt(path):
    """Return the main part of a page: its texts, and the ids that search results point to."""
    (main,) = html.parse(str(path)).xpath("//article[@role='main']")
    for element in main.xpath(".//svg | .//script | .//math | .//a[@class='headerlink']"):
        element.drop_tree()
    for element in main.iter():
        for name in set(element.attrib) - {"id", "role"}:
            del element.attrib[name]
    return html.tostring(main, encoding="unicode")


def write_excerpts(app, error):
    """Write all pages into one script, which site.js loads in a search page that was opened as a file."""
    if error or app.builder.format != "html":
        return
    pages = {
        f"{name}.html": Path(app.outdir, f"{name}.html") for name in sorted(app.env.found_docs)
    }
    texts = {name: excerpt(path) for name, path in pages.items()}
    script = f"window.PAGES = {json.dumps(texts, ensure_ascii=False)};\n"
    Path(app.outdir, "_static", "excerpts.js").write_text(script, encoding="utf-8")


def setup(app):
    """Write the script after the pages."""
    app.connect("build-finished", write_excerpts)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
