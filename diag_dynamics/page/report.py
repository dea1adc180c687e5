# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The report of a recording: the page with all its data in one HTML file."""

import base64
import json
from pathlib import Path
from typing import NamedTuple

import numpy as np

from diag_dynamics.exceptions import InputError
from diag_dynamics.page.layout import CHOSEN
from diag_dynamics.page.meshes import LEVELS, pack, pack_times

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

EVERY, SLOW = 20, ("link_energy", *CHOSEN)
"""Fields that change slowly: at the full rate one state of so many has them."""

LOGARITHMIC = ("coriolis_work", "contact_limits_mass", "contact_limits_allowed")
"""Fields of which the logarithms are packed."""

FULL_RATE_LEVELS, OF_NOISE = 16_000, 1.0 / 3.0
"""Levels of a column at the full rate, and its step as a fraction of its noise where that is
coarser."""


class Track(NamedTuple):
    """Some states of a recording in order: their description for the page and packed numbers."""

    about: dict
    blocks: list

    @property
    def size(self):
        """Bytes of the blocks."""
        return sum(map(len, self.blocks))


def overview(layout, t, numbers):
    """Return the Track of a whole recording: times after its beginning [s], and a row each."""
    return _pack_track(layout, t, numbers, {1: [field.name for field in layout.fields]}, LEVELS)


def full_rate(layout, t, numbers):
    """Return the Track of all states of some seconds, as :func:`overview`."""
    names = {
        1: [field.name for field in layout.fields if field.name not in SLOW],
        EVERY: list(SLOW),
    }
    return _pack_track(layout, t, numbers, names, FULL_RATE_LEVELS, OF_NOISE)


def _pack_track(layout, t, numbers, names, *precision):
    """Pack the fields of each entry of `names` of every so many states."""
    numbers = np.array(numbers, dtype=float)
    with np.errstate(divide="ignore", invalid="ignore"):
        for name in LOGARITHMIC:
            numbers[:, layout.places[name]] = np.log10(numbers[:, layout.places[name]])
    blocks = [pack_times(t)]
    parts = []
    for every, fields in names.items():
        columns = np.concatenate([np.arange(layout.size)[layout.places[name]] for name in fields])
        packed = pack(numbers[::every, columns], *(precision if every == 1 else ()))
        parts.append({"fields": fields, "every": every, "columns": packed.columns})
        blocks.append(packed.data)
    return Track({"rows": len(t), "logarithmic": LOGARITHMIC, "parts": parts}, blocks)


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
    """Write a report: content for JSON (``layout``, …), Tracks, and packed meshes by hash."""
    script, style, licences = page_of(static)
    blocks = []
    about = []
    for track in tracks:
        about.append(track.about | {"blocks": [len(blocks) + k for k in range(len(track.blocks))]})
        blocks += track.blocks
    places = {sha: len(blocks) + k for k, sha in enumerate(meshes)}
    texts = [base64.b64encode(block).decode("ascii") for block in (*blocks, *meshes.values())]
    text = json.dumps(
        {**content, "tracks": about, "meshes": places}, allow_nan=False, separators=(",", ":")
    )
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
