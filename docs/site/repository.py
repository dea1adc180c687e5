# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Adapt pages to the site: links to folders, docstrings, long names in tables, a first page."""

import re
import shutil
from pathlib import Path

from docutils import nodes
from sphinx.addnodes import download_reference

FOLDERS = {
    "](../config)": "](parameters.md)",
    "](../examples)": "](examples.md)",
    "](../msg)": "](interfaces.md#messages)",
    "](../srv)": "](interfaces.md#services)",
}
"""Links to folders, which GitHub lists, and the pages that show their content."""

NO_SPACE = "\u200b"
"""A place to break a line that is no space to docutils."""

LIVE = ("docs/report_panda.html",)
"""Pages that are made elsewhere: they are opened where they lie, not downloaded."""

FIRST = """<!doctype html>
<meta charset="utf-8">
<title>diag_dynamics</title>
<meta http-equiv="refresh" content="0; url=docs/index.html">
<a href="docs/index.html">diag_dynamics</a>
"""


def link_pages(_app, _name, source):
    """Link to pages in place of folders."""
    for folder, page in FOLDERS.items():
        source[0] = source[0].replace(folder, page)


def open_live_pages(_app, doctree):
    """Have a link to a live page open it."""
    for link in list(doctree.findall(download_reference)):
        if f"docs/{link['reftarget']}" in LIVE:
            link.replace_self(
                nodes.reference("", "", *link.children, refuri=link["reftarget"], internal=True)
            )


def keep_bars(_app, _what, _name, _object, _options, lines):
    """Take |r| of a docstring for an absolute value, not for a substitution."""
    lines[:] = [line.replace("|", r"\|") for line in lines]


def read_plainly(_app, what, _name, _object, _options, lines):
    """Keep napoleon from taking a property's "K = ½|ν|²: of each state" for a type, and "q, qd : …" for one of two names."""
    if what in ("property", "attribute"):
        lines.insert(
            0, "\\"
        )  # which docutils takes for nothing, and napoleon for a first line without a colon
    if "Attributes" in lines:
        for k in range(lines.index("Attributes"), len(lines)):
            names, colon, kind = lines[k].partition(" : ")
            if colon and not names.startswith(" "):
                lines[k] = names.replace(", ", f",{NO_SPACE}") + colon + kind


def skip_aliases(_app, _what, _name, member, skip, _options):
    """Leave out what a named tuple says of its fields, "Alias for field number 0": the class has said what they are."""
    return (
        True
        if (getattr(member, "__doc__", None) or "").startswith("Alias for field number")
        else skip
    )


def break_names(_app, _page, _template, context, _doctree):
    """Let long names in tables, as of tests, be broken behind a sign: else their column takes the place of all others."""

    def broken(cell):
        return re.sub(
            r'(?<=<span class="pre">)[^<]{20,}',
            lambda name: re.sub(r"(::|[_./])(?=\w)", r"\1<wbr>", name[0]),
            cell[0],
        )

    if "body" in context:
        context["body"] = re.sub(r"<td>.*?</td>", broken, context["body"], flags=re.S)


def complete(app, error):
    """Add live pages; and whoever opens the folder lands on the first page."""
    if not error and app.builder.format == "html":
        for page in LIVE:
            shutil.copyfile(Path(app.srcdir, page), Path(app.outdir, page))
        Path(app.outdir, "index.html").write_text(FIRST, encoding="utf-8")


def setup(app):
    """Take part in the build."""
    app.connect("source-read", link_pages)
    app.connect("doctree-read", open_live_pages, priority=100)  # before downloads are collected
    app.connect("autodoc-process-docstring", read_plainly, priority=400)  # before napoleon
    app.connect("autodoc-process-docstring", keep_bars)
    app.connect("autodoc-skip-member", skip_aliases)
    app.connect("html-page-context", break_names)
    app.connect("build-finished", complete)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
