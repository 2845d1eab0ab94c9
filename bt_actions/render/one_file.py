"""One HTML file with data and nothing else to need: it loads nothing, and sends nothing.

Its policy for the browser (CSP) allows its one script and its one style, by their hashes. Data
never becomes markup: a script element that is not run holds it, and no text in it can end that.
"""

from __future__ import annotations

import base64
import hashlib
import json
import re
from collections.abc import Mapping

_IMPORT = re.compile(r'^import \{ (.+?) \} from "\./(\w+)\.js";$', re.MULTILINE)
_EXPORT = re.compile(r"^export (?=(?:const|class|function) (\w+))", re.MULTILINE)


def script(main: str, modules: Mapping[str, str]) -> str:
    """Return the module `main`, and those that it imports, as one script for a page from a disk.

    A browser loads no module from a disk, so each becomes a function, called in the order of the
    imports; `modules` has their texts by name.
    """
    done: dict[str, str] = {}

    def add(name: str) -> None:
        text = modules[name]
        for imported, other in _IMPORT.findall(text):
            assert set(imported.split(", ")) <= set(_EXPORT.findall(modules[other])), other
            if other not in done:
                add(other)
        names = ", ".join(_EXPORT.findall(text))
        body = _EXPORT.sub("", _IMPORT.sub(r"const { \1 } = $\2;", text))
        done[name] = f"const ${name} = (() => {{\n{body}\nreturn {{ {names} }};\n}})();\n"

    add(main)
    return f'\n"use strict";\n(() => {{\n{"".join(done.values())}}})();\n'


def policy(script: str, style: str) -> str:
    """Return the file's rights in a browser: to run this script, and to use this style."""
    return (
        f"default-src 'none'; script-src {_hash(script)}; style-src {_hash(style)}; "
        "img-src data:; base-uri 'none'; form-action 'none'; require-trusted-types-for 'script'"
    )


def data_text(data: object) -> str:
    """Return JSON that can stand in a script element: nothing in it ends or begins anything."""
    written = json.dumps(data, separators=(",", ":"), allow_nan=False)  # ASCII only
    for character in "<>&":
        written = written.replace(character, f"\\u{ord(character):04x}")
    return written


def _hash(text: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"
