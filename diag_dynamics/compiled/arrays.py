"""Arrays where kernels find them: at an address, or all of another one's numbers in a row."""

from diag_dynamics.compiled.switch import PLAIN

if PLAIN:
    from diag_dynamics.compiled.plain import array_at, flat
else:
    from diag_dynamics.compiled.addressed import array_at, flat

__all__ = ["array_at", "flat"]
