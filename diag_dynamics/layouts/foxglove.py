# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A layout of Foxglove, or of Lichtblick, which has grown out of it: JSON with all panels by id, and a tree of splits."""

import json

from diag_dynamics.layouts.panels import MARKERS, panels

FOLLOWED = 20.0
"""Width of the plots' window, while data comes [s]."""

TITLES = {"foxglove": "foxglovePanelTitle", "lichtblick": "lichtblickPanelTitle"}
"""Key of a panel's title, by tool."""


def foxglove(model, monitor, reach, tool="foxglove"):
    """Text of a layout.

    Parameters
    ----------
    model : RobotModel
    monitor : str
        Name of the monitor on the graph, with its namespace.
    reach : float
        Of the robot [m].
    tool : {"foxglove", "lichtblick"}
    """
    shown = panels(model)
    title = TITLES[tool]
    by_id = {"3D!robot": {title: model.name, **_space(model, monitor, reach)}}
    window = {"timeWindowMode": "sliding", "playbackBarPosition": "right"} if tool == "foxglove" else {}
    by_id |= {f"Plot!{panel.name}": {title: panel.title, **_plot(panel, monitor), **window} for panel in shown}
    by_id["DiagnosticSummary!all"] = {
        **{title: "Diagnostics", "topicToRender": "/diagnostics", "minLevel": 0},
        **{"pinnedIds": [], "hardwareIdFilter": "", "sortByLevel": True},
    }
    ids = [f"Plot!{panel.name}" for panel in shown]
    half = (len(ids) + 1) // 2
    plots = _split("row", [_split("column", ids[:half]), _split("column", ids[half:])])
    left = _split("column", ["3D!robot", "DiagnosticSummary!all"], 70)
    content = {
        "configById": by_id,
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": _split("row", [left, plots], 40),
    }
    return json.dumps(content, indent=2, ensure_ascii=False) + "\n"


def _space(model, monitor, reach):
    """The robot in space, in its root link's frame: no transform is needed."""
    grid = {"layerId": "foxglove.Grid", "instanceId": "grid", "label": "Grid", "visible": True}
    grid |= {"size": 10, "divisions": 10, "lineWidth": 1, "color": "#808080ff", "position": [0, 0, 0], "order": 1}
    camera = {"perspective": True, "distance": round(3.0 * reach, 3), "phi": 65, "thetaOffset": 45, "fovy": 45}
    camera |= {"target": [0, 0, round(0.4 * reach, 3)], "targetOffset": [0, 0, 0], "targetOrientation": [0, 0, 0, 1]}
    camera |= {"near": 0.01, "far": 5000}
    return {
        "cameraState": camera,
        "followMode": "follow-pose",
        "followTf": model.root_link,
        "scene": {"ignoreColladaUpAxis": True, "meshUpAxis": "z_up"},  # as RViz, and as URDFs mean it
        "transforms": {},
        "topics": {f"{monitor}/{MARKERS}": {"visible": True}},
        "layers": {"grid": grid | {"rotation": [0, 0, 0]}},
    }


def _plot(panel, monitor):
    paths = [
        {
            "value": f"{monitor}/{one.topic}.{one.field}" + ("" if one.index is None else f"[{one.index}]"),
            "label": one.label,
            "color": one.colour,
            "enabled": True,
            "timestampMethod": "headerStamp",
        }
        for one in panel.series
    ]
    return {
        "paths": paths,
        "showXAxisLabels": True,
        "showYAxisLabels": True,
        "showLegend": True,
        "legendDisplay": "floating",
        "showPlotValuesInLegend": True,
        "isSynced": True,
        "xAxisVal": "timestamp",
        "sidebarDimension": 240,
        "followingViewWidth": FOLLOWED,
    }


def _split(direction, parts, percentage=None):
    """Tree of splits in one direction; each takes an even share, unless the first one's is given [%]."""
    first, *rest = parts
    if not rest:
        return first
    share = 100 / len(parts) if percentage is None else percentage
    return {
        "direction": direction,
        "first": first,
        "second": _split(direction, rest),
        "splitPercentage": round(share, 2),
    }
