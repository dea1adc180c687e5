# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Packages that pip installs as an extra."""

from importlib import import_module
from typing import Any

from diag_dynamics.exceptions import InputError

PACKAGES = {"yaml": "pyyaml", "distributed": "'dask[distributed]'"}
"""Names of packages that differ from those of their modules."""

EXTRAS = dict.fromkeys(
    ("lz4", "mcap", "pyarrow", "yaml", "rosbags", "scipy", "zstandard"), "recordings"
)
EXTRAS |= {"matplotlib": "plots", "distributed": "fleet", "jinja2": "fleet"}
"""Extras of the package by the module that they install."""


def require(module: str, user: str) -> Any:
    """Import a module that `user` needs."""
    try:
        return import_module(module)
    except ImportError as error:
        name = module.partition(".")[0]
        package = PACKAGES.get(name, name)
        extra = EXTRAS.get(name)
        whole = (
            f", or all packages of this kind: pip install 'diag_dynamics[{extra}]'" if extra else ""
        )
        raise InputError(
            f"{user} needs the package {name}: pip install {package}{whole}."
        ) from error
