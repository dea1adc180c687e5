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


def page_of(static=STATIC):
    """Return script, style and licences of the page; raise an InputError if it is not built."""
    try:
        return [
            (static / name).read_text(encoding="utf-8")
            for name in ("page.js", "page.css", "licences.txt")
        ]
    except OSError as error:
        raise InputError(
            f"The page is not there: {error}. In a checkout, `make page` builds it."
        ) from error


def as_text(size):
    """Return the characters that so many bytes take."""
    return 4 * -(-size // 3)


def write_report(path, content, tracks, meshes, static=STATIC):
    """Write a report.

    Its parts are content for JSON (``layout``, …), tracks, each a number of states and these as by
    :func:`~diag_dynamics.page.meshes.pack`, and packed meshes by hash.
    """
    script, style, licences = page_of(static)
    blocks = [*(data for _, data in tracks), *meshes.values()]
    texts = [base64.b64encode(block).decode("ascii") for block in blocks]
    places = {sha: len(tracks) + k for k, sha in enumerate(meshes)}
    about = {"tracks": [rows for rows, _ in tracks], "meshes": places}
    text = json.dumps(content | about, allow_nan=False, separators=(",", ":"))
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
