# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Reading and writing of YAML, with errors that name the file. PyYAML is imported on first use."""

from __future__ import annotations

import re
from collections import Counter
from functools import cache
from pathlib import Path
from typing import Any

from diag_dynamics.exceptions import InputError
from diag_dynamics.optional import require

EXPONENT = r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)[eE][-+]?[0-9]+$"
"""Numbers of YAML 1.2 that PyYAML reads as text: 1e-3."""


@cache
def _loader() -> Any:
    """Return the class of loaders."""
    yaml = require("yaml", "reading YAML")

    class Loader(yaml.SafeLoader):
        def compose_mapping_node(self, anchor: Any) -> Any:
            """Return the node of a mapping; each key is there once."""
            node = super().compose_mapping_node(anchor)
            names = [key.value for key, _ in node.value if isinstance(key, yaml.ScalarNode)]
            for name, count in Counter(names).items():
                if count > 1:
                    line = node.start_mark.line + 1
                    raise ValueError(
                        f"key {name!r} is there {count} times in the mapping at line {line}; "
                        "expected once"
                    )
            return node

    Loader.add_implicit_resolver(
        "tag:yaml.org,2002:float", re.compile(EXPONENT), list("-+.0123456789")
    )
    return Loader


def read_yaml(path: object, title: str) -> Any:
    """Return the contents of a YAML file; `title` names it in errors."""
    content = parsed_yaml(read_text(path, title), title)
    if content is None:
        raise InputError(f"{title} is empty; expected YAML.")
    return content


def read_text(path: object, title: str) -> str:
    """Return the text of a file; `title` names it in errors."""
    try:
        return Path(str(path)).expanduser().read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError, ValueError) as error:  # ValueError: a null in the name
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{title} cannot be read: {reason}.") from error


def parsed_yaml(text: str, title: str) -> Any:
    """Return the contents of YAML text."""
    yaml = require("yaml", title)
    try:
        return yaml.load(text, _loader())
    except (yaml.YAMLError, ValueError, RecursionError) as error:  # ValueError: an invalid date
        raise InputError(f"{title} is no YAML: {' '.join(str(error).split())}") from error


def yaml_text(content: Any, in_braces: bool = False) -> str:
    """Return dicts, lists, texts and numbers as YAML; numbers are read back with the same bits.

    In braces, a cut text is no YAML.
    """
    yaml = require("yaml", "writing YAML")
    options = {"sort_keys": False, "allow_unicode": True, "width": 100}
    return yaml.safe_dump(content, default_flow_style=in_braces, **options)
