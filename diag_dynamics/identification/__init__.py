# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Identification: friction, rotor inertias, payloads and inertias of links from recordings."""
