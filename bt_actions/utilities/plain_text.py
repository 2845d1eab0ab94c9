"""Texts of strangers, fit to be shown: nothing in them that a terminal obeys or XML refuses.

Names of a tree, messages of a server, variables: whatever is shown or logged comes through here.
"""

from __future__ import annotations

import json
import math
import re

_NONE = "\x7f-\x9f\u2028\u2029\u202a-\u202e\u2066-\u2069\ud800-\udfff\ufffe\uffff"
"""Controls, those that turn the direction of what follows, and characters that are none."""
_STRANGE = re.compile(f"[\x00-\x08\x0b-\x1f{_NONE}]")
_SEPARATORS = {ord(char): f"\\u{ord(char):04x}" for char in "\x85\u2028\u2029"}
"""What some readers take for the end of a line, as JSON may write it."""
_BROKEN = re.compile(f"[\x00-\x1f{_NONE}]+")


def clean(text: str) -> str:
    """Return `text` on one line, with a space in place of each run of what cannot be shown."""
    return _BROKEN.sub(" ", text)


def clean_lines(text: str) -> str:
    """Return `text` with its tabs and lines, from the second on set in, so that none passes for one
    of its own; and a space for each character that is not shown."""
    return _STRANGE.sub(" ", text).replace("\n", "\n  ")


def in_words(error: BaseException) -> str:
    """Return what a ValueError says, a sentence for people; any other as `raised` has it."""
    text = raised(error)
    return text.partition(": ")[2] or text if isinstance(error, ValueError) else text


def raised(error: BaseException) -> str:
    """Return an exception as the last line of a traceback has it: ``KeyError: 'pick_at'``."""
    try:
        said = str(error)
    except Exception:  # noqa: BLE001 - one of a stranger's may be wrong in that, too
        said = ""
    return f"{type(error).__name__}: {said}" if said else type(error).__name__


def as_json(data: object, *, ascii_only: bool = False) -> str:
    """Return plain data as one line of JSON, however lines are counted; null for what JSON has no
    number for."""
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
