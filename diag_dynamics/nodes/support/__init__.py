# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What nodes share: their life, their parameters, their diagnostics, their robot."""
