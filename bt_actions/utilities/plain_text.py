"""Foreign texts, fit to be shown: without characters that a terminal obeys or XML refuses.

Every text that is shown or logged comes through here: names of a tree, messages of a server,
variables.
"""

from __future__ import annotations

import json
import math
import re

_NONE = "\x7f-\x9f\u2028\u2029\u202a-\u202e\u2066-\u2069\ud800-\udfff\ufffe\uffff"
"""Control characters, characters that turn the direction of a text, and halves of characters."""
_STRANGE = re.compile(f"[\x00-\x08\x0b-\x1f{_NONE}]")
_SEPARATORS = {ord(char): f"\\u{ord(char):04x}" for char in "\x85\u2028\u2029"}
"""Characters that some readers take for the end of a line, as JSON may write them."""
_BROKEN = re.compile(f"[\x00-\x1f{_NONE}]+")


def clean(text: str) -> str:
    """Return `text` on one line, with a space for each run of characters that cannot be shown."""
    return _BROKEN.sub(" ", text)


def clean_lines(text: str) -> str:
    """Return `text` with its tabs and lines, and a space for each character that cannot be shown.

    All lines but the first are indented, so that none passes for a line of its own.
    """
    return _STRANGE.sub(" ", text).replace("\n", "\n  ")


def in_words(error: BaseException) -> str:
    """Return the text of a ValueError, a sentence for people; of another exception as `raised`."""
    text = raised(error)
    return text.partition(": ")[2] or text if isinstance(error, ValueError) else text


def raised(error: BaseException) -> str:
    """Return an exception as the last line of a traceback: ``KeyError: 'pick_at'``."""
    try:
        said = str(error)
    except Exception:  # noqa: BLE001 - one of a stranger's may be wrong in that, too
        said = ""
    return f"{type(error).__name__}: {said}" if said else type(error).__name__


def as_json(data: object, *, ascii_only: bool = False) -> str:
    """Return plain data as one line of JSON for any reader; null for a number that JSON lacks."""
    try:
        text = json.dumps(data, ensure_ascii=ascii_only, allow_nan=False)
    except ValueError:
        text = json.dumps(_finite(data), ensure_ascii=ascii_only)
    return text if text.isascii() else text.translate(_SEPARATORS)


def _finite(data: object) -> object:
    if isinstance(data, dict):
        return {key: _finite(value) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return [_finite(value) for value in data]
    return None if isinstance(data, float) and not math.isfinite(data) else data
