"""Parts that several kinds are built with: settings of goals, interfaces, readers of answers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import lru_cache
from types import MappingProxyType
from typing import Any

from bt_actions.behaviours.reading import Names, Reading, of_result
from bt_actions.document.building.context import Context
from bt_actions.document.reading.tree import table_of, text_of
from bt_actions.goals.policy import Busy, Retry, Timeouts
from bt_actions.messages.interfaces import Kind, interface


def goal_settings(
    settings: Mapping[str, object],
    context: Context,
    names: Names,
    timeout: Mapping[str, float] = MappingProxyType({}),
) -> dict[str, Any]:
    """Return the settings of a goal, but for its fields; `timeout` is the default."""
    given = settings.get("resources")
    resources = given if isinstance(given, list) else []
    return {
        "timeout": _timeouts(tuple({**timeout, **table_of(settings.get("timeout"))}.items())),
        "retry": retry_of(settings, context),
        "expect": context.condition(settings.get("expect"), names),
        "busy": Busy(text_of(settings, "busy") or "wait"),
        "resources": [context.joined(settings, str(each)) for each in resources],
    }


@lru_cache(maxsize=1024)
def _timeouts(fields: tuple[tuple[str, float | None], ...]) -> Timeouts:
    """Return one object for equal timeouts: most nodes of a tree have those of their action."""
    return Timeouts(**dict(fields))


def retry_of(settings: Mapping[str, object], context: Context) -> Retry:
    """Return the retry of some settings."""
    fields = {**table_of(settings.get("retry"))}
    if "outcomes" in fields:
        fields["outcomes"] = frozenset(fields["outcomes"])
    if "when" in fields:  # reads the variables of one tree, so that no other can share it
        fields["when"] = context.condition(fields["when"], of_result)
        return Retry(**fields)
    return _plain_retry(tuple(fields.items()))


@lru_cache(maxsize=1024)
def _plain_retry(fields: tuple[tuple[str, Any], ...]) -> Retry:
    return Retry(**dict(fields))


def interface_in(settings: Mapping[str, object], kind: Kind, context: Context) -> Any:
    """Return the class of the interface in settings; its name where no types are looked up."""
    return interface(str(settings["type"]), kind) if context.types else settings["type"]


def reader(
    values: Mapping[str, object], context: Context, condition: str, what: str, names: Names
) -> Callable[[Any], str]:
    """Return a function that judges an answer or a message, and keeps parts of it by `save`."""
    expect = context.condition(values.get(condition), names)
    reading = Reading(expect, context.saved(values.get("save"), names), what=what)
    reading.set_up(None)
    return reading.read
