# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Definitions of this package's messages, in the package or beside it."""

import os
from functools import cache
from pathlib import Path

from diag_dynamics.exceptions import InputError
from diag_dynamics.wire.definitions import definitions

PACKAGE = Path(__file__).resolve().parents[1]


def _folders():
    """Yield possible folders: of a wheel, of a checkout, of an installed workspace."""
    yield PACKAGE / "definitions"
    yield PACKAGE.parent / "msg"
    for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep):
        if prefix:
            yield Path(prefix) / "share" / "diag_dynamics" / "msg"


@cache
def our_definitions():
    """Return the definitions of this package's messages by type; InputError if they are not found."""
    for folder in _folders():
        if found := sorted(folder.glob("*.msg")):
            return definitions({f"diag_dynamics/msg/{one.stem}": one.read_text(encoding="utf-8") for one in found})
    raise InputError(f"the definitions of this package's messages are in none of {', '.join(map(str, _folders()))}.")
