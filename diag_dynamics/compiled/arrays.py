# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Arrays where kernels find them: at an address, or all of another one's numbers in a row; and where they lie."""

from diag_dynamics.compiled.switch import PLAIN

if PLAIN:
    from diag_dynamics.compiled.plain import address_of, array_at, flat, table_at
else:
    from diag_dynamics.compiled.addressed import address_of, array_at, flat, table_at

__all__ = ["address_of", "array_at", "flat", "table_at"]
