"""XML that has no equal here: the rows of refused.yaml."""

from __future__ import annotations

from functools import cache
from importlib.resources import files
from typing import NamedTuple

import yaml


class Row(NamedTuple):
    """Why there is no equal, and what to write by hand."""

    why: str
    instead: str

    def __str__(self) -> str:
        return f"{self.why}; write {self.instead}"


@cache
def rows() -> dict[str, Row]:
    """Return all rows, by the name of a kind, an attribute or a form."""
    text = files(__package__).joinpath("refused.yaml").read_text(encoding="utf-8")
    return {name: Row(**row) for name, row in yaml.safe_load(text).items()}
