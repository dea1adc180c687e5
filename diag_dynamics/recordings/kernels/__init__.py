# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Recursions over the states of a recording, one after the other: what cannot be done to whole columns at once."""

from diag_dynamics.compiled.kernel import ready


def prepare(entry):
    """Compile an entry kernel, or load it from the cache: the first piece shall not wait for that."""
    ready(entry)
