# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Packages that pip installs as an extra."""

from importlib import import_module
from typing import Any

from diag_dynamics.exceptions import InputError

PACKAGES = {
    "yaml": "pyyaml",
    "distributed": "'dask[distributed]'",
    "trimesh": "'trimesh[easy]'",
}
"""Names of packages that differ from those of their modules."""


def require(module: str, user: str) -> Any:
    """Import a module that `user` needs."""
    try:
        return import_module(module)
    except ImportError as error:
        name = module.partition(".")[0]
        raise InputError(
            f"{user} needs the package {name}: pip install {PACKAGES.get(name, name)}."
        ) from error
