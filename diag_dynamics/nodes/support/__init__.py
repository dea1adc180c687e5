# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Shared parts of the nodes: start and end, parameters, diagnostics, robots, messages."""
