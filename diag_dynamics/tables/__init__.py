# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tables of numbers, CSV to Parquet, read in pieces as columns of joints."""
