"""The command line: `diag-dynamics <command>`, or `python -m diag_dynamics <command>`."""
