# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Compile and cache kernels. linking.py alone uses private parts of numba."""
