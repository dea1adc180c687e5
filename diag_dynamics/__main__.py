# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""`python -m diag_dynamics`: the command line."""

import sys

from diag_dynamics.cli.main import main

sys.exit(main())
