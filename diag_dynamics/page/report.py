# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The report of a recording: the page, and all that it shows, in one HTML file that needs no server and no network."""

from __future__ import annotations

import base64
import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from diag_dynamics.arrays import Array
from diag_dynamics.exceptions import InputError
from diag_dynamics.page.layout import CHOSEN, Layout
from diag_dynamics.page.packing import LEVELS, pack, pack_times

STATIC = Path(__file__).parent / "static"
"""Where the page lies: it is built from web/ by ``make page``."""

POLICY = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:"
"""What a report may load: nothing that is not in it."""

SLOW = "link_energy", *CHOSEN
"""Fields that change slowly enough to be kept less often where states are kept at their full rate."""

LOGARITHMIC = ("coriolis_work", "contact_mass", "contact_allowed")
"""Fields of which the exponent counts: their logarithms are packed."""

EVERY = 20
"""States of which one has these."""

FULL_RATE_LEVELS, OF_NOISE = 16_000, 1.0 / 3.0
"""Values that a column can have at the full rate, and the step in parts of its noise where that is coarser."""


class Track(NamedTuple):
    """Some states of a recording, in the order of time: what the page calls them, and their packed numbers."""

    about: dict[str, Any]
    blocks: list[bytes]

    @property
    def size(self) -> int:
        """Bytes, before they are text."""
        return sum(map(len, self.blocks))


def overview(layout: Layout, t: Array, numbers: Any) -> Track:
    """States that stand for the whole recording; times in seconds after its beginning."""
    packed = pack(_scaled(layout, numbers))
    about = {
        "kind": "overview",
        "rows": len(t),
        "logarithmic": LOGARITHMIC,
        "parts": [{"fields": None, "every": 1, "columns": packed.columns}],
    }
    return Track(about, [pack_times(t), packed.data])


def full_rate(layout: Layout, t: Array, numbers: Any) -> Track:
    """All states of some seconds; the fields :data:`SLOW` of every :data:`EVERY`-th."""
    numbers, slow = _scaled(layout, numbers), np.zeros(layout.size, dtype=bool)
    for name in SLOW:
        slow[layout.place(name)] = True
    fast, few = pack(numbers[:, ~slow], FULL_RATE_LEVELS, OF_NOISE), pack(numbers[::EVERY, slow], LEVELS)
    names = [field.name for field in layout.fields]
    about = {
        "kind": "full rate",
        "rows": len(t),
        "logarithmic": LOGARITHMIC,
        "parts": [
            {"fields": [name for name in names if name not in SLOW], "every": 1, "columns": fast.columns},
            {"fields": [name for name in names if name in SLOW], "every": EVERY, "columns": few.columns},
        ],
    }
    return Track(about, [pack_times(t), fast.data, few.data])


def _scaled(layout: Layout, numbers: Any) -> Any:
    """Numbers as they are packed; those of :data:`LOGARITHMIC` fields that are zero are unknown then."""
    scaled = np.array(numbers, dtype=float)
    for name in LOGARITHMIC:
        place = layout.place(name)
        with np.errstate(divide="ignore", invalid="ignore"):
            scaled[:, place] = np.log10(scaled[:, place])
    return scaled


def page_of(static: Path = STATIC) -> list[str]:
    """Script, style and licences of the page.

    Raises
    ------
    InputError
        The page has not been built.
    """
    try:
        return [(static / name).read_text(encoding="utf-8") for name in ("page.js", "page.css", "licences.txt")]
    except OSError as error:
        raise InputError(f"The page is not there: {error}. In a checkout, `make page` builds it.") from error


def as_text(size: int) -> int:
    """Bytes that so many bytes take as text."""
    return 4 * -(-size // 3)


def write_report(
    path: str | Path,
    told: Mapping[str, Any],
    tracks: Iterable[Track],
    meshes: Mapping[str, bytes],
    static: Path = STATIC,
) -> None:
    """Write a report.

    Parameters
    ----------
    path : str or Path
    told : mapping
        For JSON: ``layout``, ``summary``, and whatever else the page tells.
    tracks : iterable of Track
        The overview first.
    meshes : mapping
        Of the scene, packed, by their hashes.
    static : Path
        Folder of the page.

    Raises
    ------
    InputError
        The page has not been built.
    """
    script, style, licences = page_of(static)
    blocks, about = [], []
    for track in tracks:
        about.append(track.about | {"blocks": [len(blocks) + k for k in range(len(track.blocks))]})
        blocks += track.blocks
    places = {sha: len(blocks) + k for k, sha in enumerate(meshes)}
    blocks += meshes.values()
    data = _for_html({**told, "tracks": about, "meshes": places})
    with open(path, "w", encoding="utf-8", newline="\n") as file:
        file.write(
            '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
            '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
            f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">\n'
            f'<title>diag_dynamics</title>\n<link rel="icon" href="data:,">\n<style>{style}</style>\n</head>\n<body>\n'
            f'<script type="application/json" id="report">{data}</script>\n'
        )
        for k, block in enumerate(blocks):
            text = base64.b64encode(block).decode("ascii")
            file.write(f'<script type="text/plain" id="block-{k}">{text}</script>\n')
        file.write(f"<script>{script}</script>\n<!--\n{licences.replace('--', '- -')}\n-->\n</body>\n</html>\n")


def _for_html(value: Any) -> str:
    """JSON that ends no element, whatever names are in it."""
    text = json.dumps(value, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")
