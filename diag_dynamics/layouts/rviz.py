# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A configuration of RViz 2: markers with the root link as fixed frame, so that no tf is needed."""

from diag_dynamics.layouts.panels import MARKERS
from diag_dynamics.yaml_files import yaml_text

SPACES = ("links", "ellipsoid", "velocity", "text", "contact")
"""Namespaces of the markers, each of which can be switched off."""


def rviz(model, monitor, reach):
    """Text of a configuration.

    Parameters
    ----------
    model : RobotModel
    monitor : str
        Name of the monitor on the graph, with its namespace.
    reach : float
        Of the robot [m].
    """
    grid = {
        "Alpha": 0.5,
        "Cell Size": 0.5,
        "Class": "rviz_default_plugins/Grid",
        "Color": "160; 160; 164",
        "Enabled": True,
        "Line Style": {"Line Width": 0.03, "Value": "Lines"},
        "Name": "Grid",
        "Normal Cell Count": 0,
        "Offset": {"X": 0, "Y": 0, "Z": 0},
        "Plane": "XY",
        "Plane Cell Count": 10,
        "Reference Frame": "<Fixed Frame>",
        "Value": True,
    }
    markers = {
        "Class": "rviz_default_plugins/MarkerArray",
        "Enabled": True,
        "Name": "Energy",
        "Namespaces": dict.fromkeys(SPACES, True),
        "Topic": _topic(f"{monitor}/{MARKERS}"),
        "Value": True,
    }
    described = {  # for those who have tf
        "Alpha": 0.3,
        "Class": "rviz_default_plugins/RobotModel",
        "Collision Enabled": False,
        "Description File": "",
        "Description Source": "Topic",
        "Description Topic": _topic(f"{monitor.rpartition('/')[0]}/robot_description", "Transient Local"),
        "Enabled": False,
        "Name": "RobotModel, needs tf",
        "TF Prefix": "",
        "Update Interval": 0,
        "Value": False,
        "Visual Enabled": True,
    }
    view = {
        "Class": "rviz_default_plugins/Orbit",
        "Distance": round(3.0 * reach, 3),
        "Focal Point": {"X": 0, "Y": 0, "Z": round(0.4 * reach, 3)},
        "Name": "Current View",
        "Near Clip Distance": 0.01,
        "Pitch": 0.4,
        "Target Frame": "<Fixed Frame>",
        "Value": "Orbit (rviz)",
        "Yaw": 0.785,
    }
    tools = ("Interact", "MoveCamera", "Select", "FocusCamera", "Measure")
    content = {
        "Panels": [
            {"Class": "rviz_common/Displays", "Name": "Displays", "Tree Height": 400},
            {"Class": "rviz_common/Views", "Name": "Views"},
        ],
        "Visualization Manager": {
            "Class": "",
            "Displays": [grid, markers, described],
            "Enabled": True,
            "Global Options": {
                "Background Color": "48; 48; 48",
                "Fixed Frame": model.root_link,
                "Frame Rate": 30,
            },
            "Name": "root",
            "Tools": [{"Class": f"rviz_default_plugins/{tool}"} for tool in tools],
            "Value": True,
            "Views": {"Current": view, "Saved": None},
        },
        "Window Geometry": {"Height": 900, "Width": 1400},
    }
    return yaml_text(content)


def _topic(name, durability="Volatile"):
    return {
        "Depth": 5,
        "Durability Policy": durability,
        "History Policy": "Keep Last",
        "Reliability Policy": "Reliable",
        "Value": name,
    }
