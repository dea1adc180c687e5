# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Layouts of viewers for one robot: files that RViz, Foxglove, Lichtblick and PlotJuggler open. No ROS, and none of them."""
