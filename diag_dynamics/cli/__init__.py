# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The command line: `diag-dynamics <command>`, or `python -m diag_dynamics <command>`."""
