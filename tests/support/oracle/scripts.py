"""Scripts of the oracle, said as the importer says them, and computed by our expressions.

`scripts.jsonl.gz` has for each script its value, the variables behind it where it gave any, or what
BehaviorTree.CPP threw. All begin with the variables that its first line names.
"""

from __future__ import annotations

import gzip
import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from bt_actions.expressions.expression import Expression
from bt_actions.expressions.text import ExpressionError
from bt_actions.importing.scripts import (
    ScriptError,
    Sorts,
    Statement,
    assigned,
    say,
    statements,
)

SCRIPTS = Path(__file__).parents[2] / "oracle" / "scripts.jsonl.gz"
DIFFERENCES = SCRIPTS.with_name("script_differences.txt")
Value = bool | int | float | str


def read(path: Path = SCRIPTS) -> Iterator[dict[str, Any]]:
    """Read the scripts of a file, each with what is run before it as `init`."""
    with gzip.open(path, "rt", encoding="utf-8") as lines:
        init = json.loads(next(lines))["meta"]["init"]
        for line in lines:
            yield {"init": init, **json.loads(line)}


def difference(case: dict[str, Any]) -> str:
    """Compute a script; tell how it differs from BehaviorTree.CPP's, or ""."""
    there = case["result"]
    try:
        value, variables = computed(case["init"], case["script"])
    except (ScriptError, ExpressionError) as error:
        return "" if "error" in there else f"{case['script']}: {error} ({there})"
    if "error" in there:
        return f"{case['script']}: {value!r} ({there})"
    given = there.get("bb", {})
    if _same(value, there["value"]) and all(_same(variables.get(key), given[key]) for key in given):
        return ""
    return f"{case['script']}: {value!r} ({there})"


def computed(init: str, script: str) -> tuple[Value, dict[str, Value]]:
    """Return the value of a script, and all variables. Raises ScriptError and ExpressionError."""
    before, code = statements(init), statements(script)
    sorts = Sorts()
    sorts.add([*before, *code])
    sorts.settle()
    variables: dict[str, Value] = {}
    value: Value = ""
    for statement in (*before, *code):
        value = _run(statement, sorts, variables)
    return value, variables


def _run(statement: Statement, sorts: Sorts, variables: dict[str, Value]) -> Value:
    def reference(name: str) -> str:
        return name

    said = (
        assigned(statement, sorts.__getitem__, reference)
        if statement.name
        else say(statement.value, sorts.__getitem__, reference)
    )
    value: Any = Expression(said.text).evaluate({}, variables.__getitem__)
    if statement.name:
        variables[statement.name] = value
    return value  # type: ignore[no-any-return]


def _same(here: object, there: object) -> bool:
    if isinstance(here, (int, float)) and isinstance(there, (int, float)):
        return math.isclose(here, there, rel_tol=1e-9, abs_tol=1e-12)
    return here == there
