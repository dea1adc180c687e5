# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""How the physics is compiled and kept: the only room that knows numba's inside."""
