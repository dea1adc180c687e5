# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Text of a URDF from a path, text, bytes or an open file: decoded, with well-formed comments.

Xacro is expanded.
"""

from __future__ import annotations

import codecs
import os
import re
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from diag_dynamics.checks import mapping
from diag_dynamics.description.check_table import warn
from diag_dynamics.entries import split_arguments
from diag_dynamics.exceptions import InputError, UrdfError
from diag_dynamics.optional import require
from diag_dynamics.text import short

# Largest URDF accepted; the largest public robot descriptions have some 200 kB
MAX_BYTES = 32 * 1024 * 1024

GIT_LFS = b"version https://git-lfs"  # first bytes of a pointer of Git LFS

DEFINITIONS = ("property", "macro", "arg")  # elements of xacro that define something for others

NO_LINK = (
    "The file has no <link>: it defines macros and calls none, or is an SRDF of MoveIt. "
    "Load the URDF, or the xacro file that calls them."
)

# The declared encoding, but for UTF-16 and UTF-32, which have a mark where they are used
_DECLARED = re.compile(rb"\s*<\?xml[^>]*?encoding\s*=\s*[\"'](?!(?i:utf))([\w.:-]+)")
_OPENING = re.compile(r"<!--|<!\[CDATA\[|<\?")
_AMPERSAND = re.compile(r"&(?!#?\w[\w.:-]*;)")
_HTML = re.compile(r"(?i)<(?:!doctype\s+html|html)\b")
_CONTROL = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def urdf_text(source: Any) -> str:
    """Return the XML text of a URDF given as text, bytes, path or open file.

    The XML declaration is removed. Bytes are UTF-8, in the declared encoding, or Latin-1. Comments
    with ``--`` and bare ampersands, which XML forbids, are corrected. Lines keep their numbers.
    """
    data = _read(source)
    text = data if isinstance(data, str) else _decoded(bytes(data))
    if len(data) > MAX_BYTES:
        raise UrdfError(f"The URDF has more than the {MAX_BYTES} bytes accepted.")
    text = re.sub(
        r"^\ufeff?\s*(<\?xml[^>]*\?>)?\s*",
        lambda match: "\n" * match[0].count("\n"),
        text.rstrip("\0"),
    )
    if not text.strip():
        raise UrdfError("The URDF is empty.")
    start = text.lstrip()[:1000]
    if _HTML.match(start):
        raise UrdfError(
            "The file is no URDF: it is HTML, a page of the web. Download the URDF itself."
        )
    if not start.startswith("<"):
        raise UrdfError(
            f"The URDF is no XML: it begins with {short(start.splitlines()[0])}; expected <robot>."
        )
    return _corrected(text)


def _read(source: Any) -> Any:
    """Return the contents of a source, up to a byte more than are accepted."""
    if isinstance(source, (bytes, bytearray)) or (isinstance(source, str) and not _is_path(source)):
        return source
    if hasattr(source, "read"):
        try:
            return source.read(MAX_BYTES + 1)
        except UnicodeError as error:
            raise UrdfError(
                f"The open file is not {source.encoding} text: {error}. Open it in binary mode."
            ) from error
    if not isinstance(source, (str, os.PathLike)):
        raise UrdfError(f"A URDF is a path or XML text, not a {type(source).__name__}.")
    path = Path(os.path.expanduser(source))
    try:
        if path.exists() and not path.is_file():  # a pipe would never end
            raise OSError(None, "it is no file")
        with path.open("rb") as file:
            return file.read(MAX_BYTES + 1)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise UrdfError(
            f"Cannot read the URDF file '{path}': {reason}. load_robot loads robots by name."
        ) from error


def _is_path(text: str) -> bool:
    stripped = text.lstrip("\ufeff \t\r\n")
    return bool(stripped) and not stripped.startswith("<") and "\n" not in stripped


def folder_of(source: Any) -> Path | None:
    """Return the folder of the file of a URDF; None of text, or of an open file without a name."""
    if isinstance(source, str) and not _is_path(source):
        return None
    place = getattr(source, "name", None) if hasattr(source, "read") else source
    place = split_arguments(place)[0] if isinstance(place, str) else place
    return Path(os.path.expanduser(place)).parent if isinstance(place, (str, os.PathLike)) else None


def _decoded(data: bytes) -> str:
    """Return the text of XML bytes.

    They are UTF-16 with a mark, UTF-8, in the declared encoding, or Latin-1.
    """
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return data.decode("utf-16", "replace")
    if data.startswith(GIT_LFS):
        raise UrdfError("The file is no URDF: it is a pointer of Git LFS. Run git lfs pull.")
    if b"\0" in data.rstrip(b"\0"):
        raise UrdfError("The file is no URDF: it is binary.")
    data = data.removeprefix(codecs.BOM_UTF8)
    declared = _DECLARED.match(data)
    for encoding in ("utf-8", declared[1].decode() if declared else "latin-1"):
        with suppress(LookupError, ValueError):  # of an unknown encoding, and of other bytes
            return data.decode(encoding)
    return data.decode("latin-1")


def _corrected(text: str) -> str:
    """Return the text with comments and ampersands as XML has them.

    tinyxml2, and so all of ROS, accepts others.
    """
    parts = []
    at = 0
    while opening := _OPENING.search(text, at):
        closing = {"<!--": "-->", "<?": "?>"}.get(opening[0], "]]>")
        end = text.find(closing, opening.end())
        if end < 0:
            break
        content = text[opening.end() : end]
        if opening[0] == "<!--":
            content = re.sub("-(?=-)", "- ", _CONTROL.sub(" ", content))
            content += " " if content.endswith("-") else ""
        parts += [_AMPERSAND.sub("&amp;", text[at : opening.start()]), opening[0], content]
        at = end
    return "".join([*parts, _AMPERSAND.sub("&amp;", text[at:])])


def read_text(source: Any) -> str:
    """Return the text of a URDF as :func:`urdf_text`, or of an expanded xacro file."""
    return urdf_text(expanded(source))


# --- Xacro files


class _Arguments(dict[str, str]):
    """Values by name; `used` are the names that xacro asked for."""

    def __init__(self, values: Mapping[str, str]) -> None:
        super().__init__(values)
        self.used = set[str]()

    def __contains__(self, name: object) -> bool:
        self.used.add(str(name))
        return super().__contains__(name)

    def __getitem__(self, name: str) -> str:
        self.used.add(str(name))
        return super().__getitem__(name)


def expanded(source: Any, arguments: Any = None) -> Any:
    """Return the text of a xacro file, a path that ends with .xacro and may have arguments behind.

    Return another source as it is.
    """
    arguments = dict(mapping("xacro_args", {} if arguments is None else arguments))
    if isinstance(source, str):
        source, in_path = split_arguments(source)
        arguments = in_path | arguments
    if not (
        isinstance(source, (str, os.PathLike)) and os.fspath(source).lower().endswith(".xacro")
    ):
        if arguments:
            names = ", ".join(map(str, arguments))
            raise InputError(f"xacro_args has {names}, but the source is no path of a .xacro file.")
        return source
    path = os.path.expanduser(os.fspath(source))
    xacro = require("xacro", f"'{path}'")
    # As xacro's command line has them
    texts = {
        str(name): str(x).lower() if isinstance(x, bool) else str(x)
        for name, x in arguments.items()
    }
    mappings = _Arguments(texts)
    try:
        document = xacro.process_file(path, mappings=mappings)
    except Exception as error:  # it has exceptions of a dozen modules
        reason = f"{type(error).__name__}: {' '.join(str(error).split())}"
        if missing := sorted(mappings.used.difference(mappings)):
            reason += f". Give {missing[0]}:=VALUE behind the path (xacro_args)."
        raise UrdfError(f"xacro cannot expand '{path}': {reason}") from error
    if not document.getElementsByTagName("link"):
        raise UrdfError(f"'{path}': {NO_LINK}")
    if unused := [name for name in texts if name not in mappings.used]:
        used = ", ".join(sorted(mappings.used)) or "none"
        listed = ", ".join(map(repr, unused))
        warn(f"The xacro argument {listed} has no effect on '{path}'; it uses {used}.")
    return document.toxml()
