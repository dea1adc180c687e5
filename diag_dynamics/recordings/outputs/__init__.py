# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Files that an analysis writes, piece by piece; each has a temporary name until it is whole."""
