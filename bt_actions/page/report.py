"""Recorded runs as one HTML file, which shows them from a disk as the server's page does."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from bt_actions.events.bare import bare
from bt_actions.events.wire import to_plain
from bt_actions.page.feed import known
from bt_actions.page.static_files import static_files
from bt_actions.recording.reading import Item, Recording
from bt_actions.recording.report import Report
from bt_actions.render.one_file import data_text, policy, script
from bt_actions.story.bare import stripped
from bt_actions.story.state import State


def page(found: Sequence[Report]) -> str:
    """Return the file: it opens with the first run, and the others are a choice away.

    Raises RecordingError.
    """
    texts = static_files()
    modules = {name[:-3]: text for name, text in texts.items() if name.endswith(".js")}
    code, style = script("main", modules), texts["drawing.css"] + texts["style.css"]
    data = data_text([_run(each) for each in found])
    within = {
        '<meta charset="utf-8">': '<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{policy(code, style)}">',
        '<link rel="stylesheet" href="drawing.css">\n': "",
        '<link rel="stylesheet" href="style.css">': f"<style>{style}</style>",
        '<script type="module" src="main.js"></script>\n': "",
        "</body>": f'<script type="application/json" id="stored">{data}</script>\n'
        f"<script>{code}</script>\n</body>",
    }
    text = texts["index.html"]
    for place, part in within.items():
        head, place, tail = text.partition(place)
        assert place
        text = f"{head}{part}{tail}"
    return text


def _run(report: Report) -> dict[str, Any]:
    state, recording = report.state, Recording(report.recording.first)
    began, ended = state.began, state.ended
    assert began is not None
    items = (_plain(each, values=report.values) for each in recording.items())
    return {
        "run": {
            "run_id": began.run_id,
            "tree": began.tree,
            "began": began.at.wall,
            "seconds": state.elapsed,
            "status": state.status.value if report.is_over else "",
            "cause": ended.cause if ended is not None else "",
            "written": report.goes_on,
        },
        "events": [each for each in items if each is not None],
        "ended": ended is not None,
        "damaged": recording.damaged,
        "values": report.values,
    }


def _plain(item: Item, *, values: bool) -> dict[str, Any] | None:
    if isinstance(item, State):
        return known(item if values else stripped(item))
    event = item if values else bare(item)
    return None if event is None else to_plain(event)
