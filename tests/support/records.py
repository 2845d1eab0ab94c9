"""What is on record of goals without an answer (recovery/ledger.py)."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from bt_actions.recovery.ledger import LENGTH


def on_record(path: Path) -> list[Any]:
    """What a process's file says of each goal."""
    text = path.read_bytes()
    return [json.loads(text[at : at + LENGTH]) for at in range(0, len(text), LENGTH) if text[at]]
