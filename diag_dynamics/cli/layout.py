# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""`diag-dynamics layout`: a layout of Foxglove or PlotJuggler for one robot, whose plots have the names of joints."""

import json
import re
import xml.etree.ElementTree as ET
from pathlib import Path

from diag_dynamics.cli import common
from diag_dynamics.exceptions import InputError
from diag_dynamics.plot.drawing import COLOURS

EPILOG = """Give the monitor's parameters too, because mimic, locked_joints and floating_base change the order of joints. The
layouts follow the source code of the viewers; they are unverified in the viewers."""

OUTPUTS = {"-o": "output"}

PANELS = {
    "Kinetic energy K and shares ½ν² [J]": {
        "K": "kinetic_energy.total",
        "": "kinetic_energy.energy_share",
    },
    "Power νᵀ(ε − ε_g) [W]": {"dK/dt by efforts and gravity": "kinetic_energy.power"},
    "Total joint rates ν [J^½]": {"": "total_joint_rates.nu"},
    "Working moments ε [J^½/s]": {"": "working_moments.epsilon"},
    "Coriolis term C [J^½/s]": {"": "coriolis.coriolis"},
    "Articulated inertia D [kg m², kg]": {"": "state.articulated_inertia"},
    "External torque m r [N m, N]": {"": "external_torque.external_torque"},
    "Residual |r| [J^½/s]": {
        "|r|": "external_torque.norm",
        "threshold of |r|": "external_torque.threshold",
    },
}
"""Fields of topics by label, and by title of their plot. A field without a label has an entry for each joint."""


def foxglove(model, monitor):
    """Return a Foxglove layout of a model and its monitor: markers, a plot for each panel, diagnostics."""
    title, grid = (
        "foxglovePanelTitle",
        {"layerId": "foxglove.Grid", "instanceId": "grid", "visible": True},
    )
    space = {
        title: model.name,
        "followMode": "follow-pose",
        "followTf": model.root_link,
        "layers": {"grid": grid},
    }
    space["scene"] = {
        "ignoreColladaUpAxis": True,
        "meshUpAxis": "z_up",
    }  # as RViz, and as URDFs mean it
    space["topics"] = {f"{monitor}/markers": {"visible": True}}
    panels = {
        "3D!robot": space,
        "DiagnosticSummary!all": {title: "Diagnostics", "topicToRender": "/diagnostics"},
    }
    plots = []
    for number, heading in enumerate(PANELS):
        paths = [
            {
                "value": f"{monitor}/{field}" + ("" if index is None else f"[{index}]"),
                "label": label,
                "color": color,
            }
            | {"enabled": True, "timestampMethod": "headerStamp"}
            for label, field, index, color in _series(model, heading)
        ]
        plots.append(f"Plot!{number}")
        panels[plots[-1]] = {
            title: heading,
            "paths": paths,
            "xAxisVal": "timestamp",
            "followingViewWidth": 20,
        }
        panels[plots[-1]] |= {
            "showLegend": True,
            "legendDisplay": "floating",
            "showPlotValuesInLegend": True,
        }
    columns = [_split("column", plots[::2]), _split("column", plots[1::2])]
    layout = _split("row", [_split("column", ["3D!robot", "DiagnosticSummary!all"]), *columns])
    content = {
        "configById": panels,
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
    }
    return json.dumps({**content, "layout": layout}, indent=2, ensure_ascii=False) + "\n"


def plotjuggler(model, monitor):
    """Return a PlotJuggler layout, in which functions rename entries of arrays."""
    root = ET.Element("root")
    tab = ET.SubElement(
        ET.SubElement(root, "tabbed_widget", parent="main_window", name="Main Window"), "Tab"
    )
    tab.set("tab_name", model.name)
    tab.set("containers", "1")
    sizes = ";".join([f"{1 / len(PANELS):.6f}"] * len(PANELS))
    container = ET.SubElement(tab, "Container")
    splitter = ET.SubElement(
        container, "DockSplitter", orientation="-", count=str(len(PANELS)), sizes=sizes
    )
    equations, topics = ET.Element("customMathEquations"), set()
    for heading in PANELS:
        area = ET.SubElement(splitter, "DockArea", name=heading)
        plot = ET.SubElement(
            area, "plot", mode="TimeSeries", style="Lines", flip_x="false", flip_y="false"
        )
        for label, field, index, color in _series(model, heading):
            topic, name = field.split(".")
            topics.add(f"{monitor}/{topic}")
            curve = f"{monitor}/{topic}/{name}"
            if index is not None:
                source, curve = (
                    f"{curve}[{index}]",
                    f"{monitor.rpartition('/')[0]}/{name}/{label}".lstrip("/"),
                )
                snippet = ET.SubElement(equations, "snippet", name=curve, language="lua")
                ET.SubElement(snippet, "global")
                ET.SubElement(snippet, "function").text = "return value"
                ET.SubElement(snippet, "linked_source").text = source
            ET.SubElement(plot, "curve", name=curve, color=color)
    root.append(equations)
    ET.SubElement(root, "streaming_buffer_size", value="60")
    streamer = "ROS2 Topic Subscriber"
    plugin = ET.SubElement(ET.SubElement(root, "Plugins"), "plugin", ID=streamer)
    ET.SubElement(plugin, "use_header_stamp", value="true")
    ET.SubElement(plugin, "max_array_size", value=str(max(100, model.nv)))
    ET.SubElement(plugin, "selected_topics", value=";".join(sorted(topics)))
    ET.SubElement(root, "previouslyLoaded_Streamer", name=streamer)
    ET.indent(root, " ")
    return "<?xml version='1.0' encoding='UTF-8'?>\n" + ET.tostring(root, encoding="unicode") + "\n"


def _series(model, heading):
    """Yield label, field, index and color of the lines of a panel; an index of None: the field is one number."""
    number = 0
    for label, field in PANELS[heading].items():
        for index, name in enumerate(model.dof_names) if not label else [(None, label)]:
            yield name, field, index, COLOURS[number % len(COLOURS)]
            number += 1


def _split(direction, parts):
    """Return a tree of even splits in one direction."""
    first, *rest = parts
    if not rest:
        return first
    second = _split(direction, rest)
    return {
        "direction": direction,
        "first": first,
        "second": second,
        "splitPercentage": round(100 / len(parts), 2),
    }


TOOLS = {"foxglove": foxglove, "plotjuggler": plotjuggler}


def add_arguments(parser):
    """Declare the arguments."""
    common.add_robot(parser)
    parser.add_argument("--tool", required=True, choices=TOOLS, help="the viewer")
    text = "name of the monitor on the graph (default: /diag_dynamics)"
    parser.add_argument("--monitor", default="/diag_dynamics", help=text)
    common.add_parameters(parser)
    parser.add_argument("-o", "--output", metavar="FILE", help="the file (default: stdout)")


def run(chosen):
    """Write a layout; return the exit status."""
    if not re.fullmatch(r"(/\w+)+", chosen.monitor):
        raise InputError(
            f"--monitor is '{chosen.monitor}'; expected an absolute name such as /arm/diag_dynamics."
        )
    text = TOOLS[chosen.tool](common.chosen_model(chosen), chosen.monitor)
    if chosen.output in (None, "-"):
        print(text, end="")
    else:
        Path(chosen.output).expanduser().write_text(text, encoding="utf-8")
        common.report_written(chosen.output)
    return common.DONE
