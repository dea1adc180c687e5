# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Compile and cache kernels. Only linking.py uses private parts of numba; tables.py has types."""
