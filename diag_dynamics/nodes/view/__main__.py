# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The view, by ``python3 -m diag_dynamics.nodes.view``."""

import sys

from diag_dynamics.nodes.view.view import main

sys.exit(main())
