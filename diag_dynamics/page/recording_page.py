# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The report of a recording: the page with all its data in one HTML file."""

import base64
import json
from pathlib import Path

from diag_dynamics.exceptions import InputError

STATIC = Path(__file__).parent / "static"
"""Folder of the page, which ``make page`` builds from web/."""

HEAD = """<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; \
script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:">
<title>diag_dynamics</title>
<link rel="icon" href="data:,">
<style>STYLE</style>
</head>
<body>
"""
"""A report loads nothing that is not in it."""


def write_report(path, content, states, meshes, static=STATIC):
    """Write a report; raise an InputError if the page is not built.

    Its parts are content for JSON (``layout``, …), ``states`` among them as their number, states as
    by :func:`~diag_dynamics.page.meshes.pack`, and packed meshes by hash.
    """
    try:
        script, style, licences = (
            (static / name).read_text(encoding="utf-8")
            for name in ("page.js", "page.css", "licences.txt")
        )
    except OSError as error:
        raise InputError(
            f"The page is not there: {error}. In a checkout, `make page` builds it."
        ) from error
    places = {sha: 1 + k for k, sha in enumerate(meshes)}
    texts = [base64.b64encode(block).decode("ascii") for block in (states, *meshes.values())]
    text = json.dumps(content | {"meshes": places}, allow_nan=False, separators=(",", ":"))
    for character in "<>&":  # no name ends an element
        text = text.replace(character, f"\\u{ord(character):04x}")
    parts = [
        HEAD.replace("STYLE", style),
        f'<script type="application/json" id="report">{text}</script>\n',
        *(
            f'<script type="text/plain" id="block-{k}">{block}</script>\n'
            for k, block in enumerate(texts)
        ),
        f"<script>{script}</script>\n<!--\n{licences.replace('--', '- -')}\n-->\n"
        "</body>\n</html>\n",
    ]
    with open(path, "w", encoding="utf-8", newline="\n") as file:
        file.writelines(parts)
