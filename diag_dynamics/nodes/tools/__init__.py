# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A look at the graph for whoever has no ros2cli, which PyPI lacks: its words, as far as this package needs them."""
