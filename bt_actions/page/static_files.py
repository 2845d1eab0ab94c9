"""The files of the page: its own, and the modules that a drawn tree shares with it."""

from __future__ import annotations

from pathlib import Path

from bt_actions.render.look import STATIC


def static_files() -> dict[str, str]:
    """Return the texts of the files by name."""
    folders = (STATIC, Path(__file__).parent / "static")
    return {path.name: path.read_text("utf-8") for each in folders for path in each.iterdir()}
