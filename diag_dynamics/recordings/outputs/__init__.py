# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Files that an analysis writes, batch by batch; each has a temporary name until it is complete.

An output has `write(piece)` for each :class:`~diag_dynamics.recordings.analysis.Piece`, then
`close(summary)`, which gives the file its name, or `drop()`, which deletes it.
"""
