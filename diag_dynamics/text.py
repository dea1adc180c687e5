# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Text that others have written, such as the names of joints, made safe to show: on terminals, in logs, in files."""

import unicodedata

_HIDDEN = {"Cc", "Cf", "Cs", "Zl", "Zp"}
"""Categories of characters that act instead of being seen: controls, formats (those that turn the direction of writing among
them), surrogates, separators of lines and of paragraphs."""


class _Escapes(dict):
    """What str.translate puts in the place of a character, by its number."""

    def __missing__(self, code):
        if unicodedata.category(chr(code)) not in _HIDDEN:
            raise LookupError(code)
        return f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08x}"


_ESCAPES = _Escapes()


def plain(text: str) -> str:
    r"""The text with every character that would act on a terminal or a log, instead of being seen, as ``\x1b`` or ``\u202e``.

    Letters of all languages stay as they are, and so does what has been escaped before: doing it twice changes nothing. A
    backslash is a backslash, so a name that holds one of these four characters in a row looks like an escaped one.

    Parameters
    ----------
    text : str

    Returns
    -------
    str
        Of one line.
    """
    return text if text.isprintable() else text.translate(_ESCAPES)
