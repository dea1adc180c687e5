# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The monitor, by ``python3 -m diag_dynamics.nodes.monitor``."""

from diag_dynamics.nodes.support.runner import main

main("monitor")
