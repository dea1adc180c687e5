# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Messages as bytes: the fast way from a joint state to all that is said about it. Nodes work without it."""
