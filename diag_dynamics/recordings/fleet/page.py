# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The table of a fleet as a page: fleet.html, which leads to the report and the summary of each recording."""

import html
import json
from pathlib import Path
from urllib.parse import quote

from diag_dynamics.recordings.fleet.table import collisions_of

POLICY = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data:"
"""What the page may load: nothing."""

COLUMNS = (
    ("recording", "", "as it was found, without what all paths begin with"),
    ("robot", "", ""),
    ("duration", "s", ""),
    ("states", "", ""),
    ("K max", "J", "largest kinetic energy"),
    ("explained", "%", "part of dK/dt that the balance of power explains; less than 80 % is red"),
    ("residual", "W", "power that it does not explain, rms"),
    ("external", "N m", "largest external torque of a joint"),
    ("contacts", "", "collisions by the thresholds that were given"),
    ("rejected", "", "messages that are no states"),
    ("warnings", "", ""),
)
"""Headings, units and what they mean."""

LITTLE = 0.8
"""Explained part below which something is wrong."""

STYLE = """
:root { color-scheme: light dark; --page: light-dark(#f3f4f6, #0d1116); --panel: light-dark(#fff, #151b22);
  --line: light-dark(#d9dee5, #27303a); --text: light-dark(#1c232b, #dde4ec); --dim: light-dark(#5f6b78, #8c98a5);
  --accent: light-dark(#2f6fb0, #6cb0ee); --bad: light-dark(#c9392f, #ef6a60); }
body { margin: 0; padding: 1rem; background: var(--page); color: var(--text); font: 0.95rem/1.4 system-ui, sans-serif;
  font-variant-numeric: tabular-nums; }
h1 { font-size: 1.3rem; margin: 0 0 0.6rem; }
h2 { font-size: 1rem; margin: 1.2rem 0 0.4rem; }
p { margin: 0.2rem 0; color: var(--dim); }
b { color: var(--text); }
div { overflow-x: auto; border: 1px solid var(--line); border-radius: 0.6rem; background: var(--panel); margin-top: 0.8rem; }
table { border-collapse: collapse; width: 100%; }
th, td { padding: 0.3rem 0.7rem; text-align: right; white-space: nowrap; border-top: 1px solid var(--line); }
thead th { border: 0; color: var(--dim); font-weight: 500; cursor: pointer; user-select: none; }
thead th:hover, [aria-sort] { color: var(--accent); }
[aria-sort="ascending"]::after { content: " ▲"; } [aria-sort="descending"]::after { content: " ▼"; }
th:first-child, td:first-child, th:nth-child(2), td:nth-child(2) { text-align: left; }
th:first-child, td:first-child { position: sticky; left: 0; background: var(--panel); }
td:first-child { white-space: normal; overflow-wrap: anywhere; min-width: 10rem; }
small { color: var(--dim); font-weight: 400; }
a { color: var(--accent); text-decoration: none; } a:hover { text-decoration: underline; }
.bad { color: var(--bad); font-weight: 600; }
li { overflow-wrap: anywhere; }
"""

SCRIPT = """
for (const head of document.querySelectorAll("thead th")) head.addEventListener("click", () => {
  const sign = head.getAttribute("aria-sort") === "descending" ? 1 : -1, k = head.cellIndex;
  for (const other of head.parentNode.children) other.removeAttribute("aria-sort");
  head.setAttribute("aria-sort", sign > 0 ? "ascending" : "descending");
  const key = (row) => row.cells[k].dataset.value, body = head.closest("table").tBodies[0];
  const order = (a, b) => a === "" || b === "" ? (a === "") - (b === "")
    : sign * (isNaN(a) || isNaN(b) ? a.localeCompare(b) : a - b);
  body.append(...[...body.rows].sort((a, b) => order(key(a), key(b))));
});
"""


def page_of(report, outputs):
    """The page as text.

    Parameters
    ----------
    report : dict
        What is in fleet.json.
    outputs : dict
        Of each recording, by path, names of its files beside the page: its report, if there is one, and its summary.
    """
    rows, failed = report["recordings"], report["failed"]
    heads = "".join(
        f'<th title="{html.escape(said)}">{html.escape(name)}{f" <small>{unit}</small>" if unit else ""}</th>'
        for name, unit, said in COLUMNS
    )
    start = _start([row["recording"] for row in rows])
    body = "\n".join(_row(row, outputs.get(row["recording"], []), start) for row in rows)
    robots = "\n".join(_robot(robot, start) for robot in report["robots"])
    wrong = "".join(f"<li>{html.escape(path)}: {html.escape(text)}</li>" for path, text in failed.items())
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">\n'
        f'<title>{len(rows)} recordings · diag_dynamics</title>\n<link rel="icon" href="data:,">\n'
        f"<style>{STYLE}</style>\n</head>\n<body>\n<h1>{len(rows)} recordings</h1>\n{robots}\n"
        f"<div><table>\n<thead><tr>{heads}</tr></thead>\n<tbody>\n{body}\n</tbody>\n</table></div>\n"
        + (f"<h2>Not analysed: {len(failed)}</h2>\n<ul>{wrong}</ul>\n" if failed else "")
        + f"<script>{SCRIPT}</script>\n</body>\n</html>\n"
    )


def _start(paths):
    """Folders that all paths begin with, as text."""
    parts = [Path(path).parent.parts for path in paths]
    same = 0
    while parts and all(len(own) > same and own[same] == parts[0][same] for own in parts):
        same += 1
    return str(Path(*parts[0][:same])) if same else ""


def _shown(path, start):
    return path.removeprefix(start).lstrip("/") if start else path


def _percent(part):
    """A part in percent: how far below zero it is, says nothing."""
    return "< 0" if part < 0.0 else f"{100.0 * part:.1f}"


def _robot(robot, start):
    energy, explained, hours = robot["kinetic_energy"], robot["explained"], robot["hours"]
    said = [
        f"{robot['recordings']} recordings",
        f"{hours:.4g} h" if hours >= 1.0 else f"{60.0 * hours:.3g} min",
        f"K at most {energy['max']:.4g} J in {_shown(energy['recording'], start)}",
        *([] if explained is None else [f"the balance explains {_percent(explained)} %"]),
        collisions_of(robot, "contacts"),
    ]
    return f"<p><b>{html.escape(robot['robot'])}</b>: {html.escape(', '.join(said))}</p>"


def _row(row, outputs, start):
    path = row["recording"]
    shown = html.escape(_shown(path, start))
    names = [html.escape(quote(name)) for name in outputs]
    name = f'<a href="{names[0]}" title="{html.escape(path)}">{shown}</a>' if names else shown
    rest = "".join(f' <small><a href="{one}">summary</a></small>' for one in names[1:])
    explained = row["explained"]
    numbers = (
        (3600.0 * row["hours"], False),
        (row["states"], False),
        (row["kinetic_energy_max"], False),
        (explained, explained is not None and explained < LITTLE, _percent),
        (row["residual_power"], False),
        (row["external_torque_max"], False),
        (row["collisions"], False),
        (row["rejected"], row["rejected"] > 0),
        (row["warnings"], row["warnings"] > 0),
    )
    cells = f'<td data-value="{html.escape(path)}">{name}{rest}</td>'
    cells += f'<td data-value="{html.escape(row["robot"])}">{html.escape(row["robot"])}</td>'
    return f"<tr>{cells}{''.join(_cell(*one) for one in numbers)}</tr>"


def _number(value):
    return str(value) if isinstance(value, int) else f"{value:.4g}"


def _cell(value, is_bad, said=_number):
    text = "–" if value is None else said(value)
    known = "" if value is None else json.dumps(value)
    return f'<td data-value="{known}"{is_bad * " class=bad"}>{text}</td>'
