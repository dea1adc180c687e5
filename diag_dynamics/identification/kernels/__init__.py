# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Regressors of momentum and gravity, their filter and normal equations, over the states of a recording in one pass."""

from diag_dynamics.compiled.kernel import ready


def prepare(entry):
    """Compile an entry kernel, or load it from the cache: the first segment shall not wait for that."""
    ready(entry)
