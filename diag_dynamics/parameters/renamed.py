# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Names and values of parameters before version 0.2, which are accepted with a warning until version 0.3."""

import warnings

RENAMED = {
    **{
        f"absurd.{limit}": f"plausibility.{limit}"
        for limit in ("position", "velocity", "effort", "beyond_limits", "beyond_velocity", "beyond_effort", "jump")
    },
    "frozen_timeout": "stuck_timeout",
    "frozen_values": "stuck_values",
}
"""Current names by old ones."""

RENAMED_VALUES = {name: {"refuse": "reject"} for name in ("foreign_time", "missing_velocity", "stuck_values")}
"""Current values by old ones, by the current name of the parameter."""


def warn_user(text):
    """Warn by Python's warnings."""
    warnings.warn(text, FutureWarning, stacklevel=3)


def current(name, value, warn=warn_user):
    """Return the current name and value of a parameter; call `warn` with a text if either is an old one."""
    new_name = RENAMED.get(name, name)
    values = RENAMED_VALUES.get(new_name, {})
    new_value = values.get(value, value) if isinstance(value, str) else value
    if new_name != name:
        warn(f"Parameter '{name}' is renamed to '{new_name}'. Version 0.3 rejects the old name.")
    if new_value != value:
        warn(f"Parameter '{new_name}' is '{value}'; expected '{new_value}'. Version 0.3 rejects the old value.")
    return new_name, new_value


def current_parameters(values, warn=warn_user):
    """Return parameters by their current names; a value under the current name replaces one under the old name."""
    old_first = sorted(values.items(), key=lambda item: item[0] not in RENAMED)
    return dict(current(name, value, warn) for name, value in old_first)
