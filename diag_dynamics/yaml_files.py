# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""YAML read with errors that name the file. PyYAML is imported when it is needed: who reads no file need not wait for it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from diag_dynamics.exceptions import InputError
from diag_dynamics.optional import require


def read_yaml(path: object, what: str) -> Any:
    """Return the contents of a YAML file, {} of an empty one; `what` names it in errors."""
    try:
        text = Path(str(path)).expanduser().read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError, ValueError) as error:  # ValueError: of a name that holds a null character
        raise InputError(f"{what} cannot be read: {getattr(error, 'strerror', None) or error}.") from error
    content = parsed_yaml(text, what)
    return {} if content is None else content


def parsed_yaml(text: str, what: str) -> Any:
    """Contents of YAML text."""
    yaml = require("yaml", what)
    try:
        return yaml.safe_load(text)
    except (yaml.YAMLError, ValueError, RecursionError) as error:  # ValueError: of a date that is none
        hint = ". Put a text that begins with * in quotes." if "scanning an alias" in str(error) else ""
        raise InputError(f"{what} is no YAML: {' '.join(str(error).split())}{hint}") from error


def yaml_text(content: Any) -> str:
    """YAML of plain dicts, lists, texts and numbers, in their order; every number is read back with the same bits."""
    return require("yaml", "writing YAML").safe_dump(content, sort_keys=False, allow_unicode=True, width=100)
