# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The switch between compiling fast and compiling plainly."""

import os

import numba

TESTED = (0, 68)
"""The numba that the private parts were written for and tested with; any other compiles plainly."""

PLAIN = os.environ.get("DIAG_DYNAMICS_PLAIN", "") not in ("", "0") or numba.version_info[:2] != TESTED
"""Whether kernels are compiled by numba's documented interface alone: slower, for a numba that has changed inside."""
