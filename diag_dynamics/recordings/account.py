# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""See recordings.findings."""

from diag_dynamics.recordings.findings import Finding, without_efforts, without_states

__all__ = ["Finding", "without_efforts", "without_states"]
