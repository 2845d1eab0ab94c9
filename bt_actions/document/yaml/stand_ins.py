"""Characters that libyaml reads by other rules than YAML 1.2, kept from it while it parses.

libyaml ends a line at U+0085, U+2028 and U+2029, as YAML 1.1 had it, and refuses a character that
JSON writes as two halves of UTF-16 (``"\\ud83d\\ude00"``). A stand-in takes the place of each such
character: a code point that Unicode sets aside, and that no text holds. Every place stays the same.
"""

from __future__ import annotations

import re

_SEPARATORS = {"\x85": "\ufdd0", "\u2028": "\ufdd1", "\u2029": "\ufdd2"}
_BACKSLASH = "\ufdd3"
_RESTORED = str.maketrans({inside: char for char, inside in _SEPARATORS.items()})
_HALVES = r"u(d[89ab][0-9a-f]{2})%su(d[c-f][0-9a-f]{2})"
_PAIR = re.compile(r"(?<!\\)((?:\\\\)*)\\" + _HALVES % r"\\", re.IGNORECASE)
_PUT_AWAY = re.compile(_BACKSLASH + _HALVES % _BACKSLASH, re.IGNORECASE)


def replaced(text: str) -> str:
    """Return a text with the stand-ins in it; the text itself where it needs none."""
    if "\\u" in text:
        text = _PAIR.sub(rf"\1{_BACKSLASH}u\2{_BACKSLASH}u\3", text)
    if not text.isascii():
        for char, inside in _SEPARATORS.items():
            text = text.replace(char, inside)
    return text


def restored(text: str, *, quoted: bool) -> str:
    """Return the text of a scalar without stand-ins; only in double quotes a backslash escapes."""
    if quoted:
        text = _PUT_AWAY.sub(_joined, text)
    return text.translate(_RESTORED).replace(_BACKSLASH, "\\")


def _joined(pair: re.Match[str]) -> str:
    return bytes.fromhex(pair[1] + pair[2]).decode("utf-16-be")
