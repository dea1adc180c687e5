# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Many recordings on many machines: a task for each, or for each piece of a long one, by Dask."""
