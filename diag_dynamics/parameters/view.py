# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters of the view."""

from diag_dynamics.parameters.spec import Spec, fixed

PARAMETERS = fixed(
    {
        "host": Spec(
            "127.0.0.1",
            "Listen address. "
            "0.0.0.0 allows access from other machines; there is no authentication.",
        ),
        "port": Spec(8420, "Port of the page; 0: a free port, which the log reports."),
        "robots": Spec([""], "Namespaces or full names of the monitors to show; by default all."),
        "rate": Spec(60.0, "Maximum frame rate per tab [Hz].", 0.1, 240.0),
    }
)
"""Specs by name."""
