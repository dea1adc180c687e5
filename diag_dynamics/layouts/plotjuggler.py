# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A layout of PlotJuggler: XML with a tab of energies and one of the rest, each curve under its joint's name.

An entry of an array is a curve such as coriolis[3] there; a function of one line gives it its joint's name.
"""

import xml.etree.ElementTree as ET

from diag_dynamics.layouts.panels import panels

STREAMER = "ROS2 Topic Subscriber"
"""Name of PlotJuggler's plugin for topics of ROS 2."""

FIRST = ("energy", "power", "rates", "moments")
"""Panels of the first tab."""


def plotjuggler(model, monitor):
    """Text of a layout.

    Parameters
    ----------
    model : RobotModel
    monitor : str
        Name of the monitor on the graph, with its namespace.
    """
    shown = panels(model)
    root = ET.Element("root")
    tabs = ET.SubElement(root, "tabbed_widget", parent="main_window", name="Main Window")
    for title, wanted in (("energy", True), ("dynamics", False)):
        _tab(tabs, title, [panel for panel in shown if (panel.name in FIRST) == wanted], monitor)
    ET.SubElement(tabs, "currentTabIndex", index="0")
    ET.SubElement(root, "use_relative_time_offset", enabled="1")
    ET.SubElement(root, "streaming_buffer_size", value="60")
    series = [one for panel in shown for one in panel.series]
    topics = sorted({f"{monitor}/{one.topic}" for one in series})
    plugin = ET.SubElement(ET.SubElement(root, "Plugins"), "plugin", ID=STREAMER)
    for name, value in (
        ("use_header_stamp", "true"),
        ("discard_large_arrays", "false"),
        ("max_array_size", str(max(100, model.nv))),
        ("boolean_strings_to_number", "true"),
        ("remove_suffix_from_strings", "true"),
        ("selected_topics", ";".join(topics)),
    ):
        ET.SubElement(plugin, name, value=value)
    ET.SubElement(root, "previouslyLoaded_Streamer", name=STREAMER)
    equations = ET.SubElement(root, "customMathEquations")
    for one in series:
        if one.index is not None:
            snippet = ET.SubElement(equations, "snippet", name=_curve(one, monitor), language="lua")
            ET.SubElement(snippet, "global")
            ET.SubElement(snippet, "function").text = "return value"
            ET.SubElement(snippet, "linked_source").text = f"{monitor}/{one.topic}/{one.field}[{one.index}]"
    ET.indent(root, " ")
    return "<?xml version='1.0' encoding='UTF-8'?>\n" + ET.tostring(root, encoding="unicode") + "\n"


def _curve(series, monitor):
    """Name of a curve."""
    if series.index is None:
        return f"{monitor}/{series.topic}/{series.field}"
    return f"{monitor.rpartition('/')[0]}/{series.field}/{series.label}".lstrip("/")


def _tab(tabs, title, shown, monitor):
    """Panels one below the other."""
    tab = ET.SubElement(tabs, "Tab", tab_name=title, containers="1")
    sizes = ";".join([f"{1 / len(shown):.6f}"] * len(shown))
    container = ET.SubElement(tab, "Container")
    splitter = ET.SubElement(container, "DockSplitter", orientation="-", count=str(len(shown)), sizes=sizes)
    for panel in shown:
        area = ET.SubElement(splitter, "DockArea", name=panel.title)
        plot = ET.SubElement(area, "plot", mode="TimeSeries", style="Lines", flip_x="false", flip_y="false")
        ET.SubElement(plot, "range", left="0.0", right="20.0", top="1.0", bottom="0.0")
        ET.SubElement(plot, "limitY")
        for one in panel.series:
            ET.SubElement(plot, "curve", name=_curve(one, monitor), color=one.colour)
