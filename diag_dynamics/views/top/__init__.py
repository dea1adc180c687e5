# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The terminal view `top`: a robot's joints by what they do, with peaks, limits, sparklines and a chart."""
