"""Writes docs/python.md, the reference of the public names, from their docstrings.

`python scripts/python_doc.py` writes it; with `--check` it exits 1, and says so, when what is there
is stale.
"""

from __future__ import annotations

import ast
import inspect
import re
import sys
import textwrap
from enum import Enum
from pathlib import Path
from typing import Any

from py_trees.behaviour import Behaviour

import bt_actions
from bt_actions import document, events, testing

PATH = Path(__file__).resolve().parent.parent / "docs" / "python.md"

HEAD = """\
# The Python API

<!-- Made by scripts/python_doc.py from the docstrings. Do not edit. -->

`import bt_actions` gives the names on this page, but for the three parts at its end. How a tree of
your own is made of them and run stands in the [README](../README.md#in-your-own-py_trees-tree), and
how they live in a program of yours in [embedding.md](embedding.md). `bt_actions.testing` runs them
in virtual time ([testing.md](testing.md)). Times are seconds.

What holds everywhere:

- **A tick never waits.** Anybody may tick: `TreeRunner`, py_trees' own loops, a timer.
- **The goals need no tick.** From its request to its end a goal is driven by what arrives and by a
  thread of its own: it is canceled and drained also where nobody ticks, or spins, any more.
- **Somebody must spin the node** while the tree runs, for its topics, services and clock.
  `TreeRunner` does, unless it was given a node that is in an executor. No behaviour may:
  `rclpy.spin_until_future_complete(node, ...)` takes the node out of its executor, and the run ends
  with a TreeError that names the behaviour.
- **In a callback** of anybody's executor a `TreeRunner` that was given no node can `run()`. On the
  node that the callback belongs to it can where another thread of the executor is free for the
  answers; else `start()` it, and take the status in a done callback of its `future`.
- **`shutdown()` cancels and waits** until each goal is accounted for, at most as long as its
  `timeout.cancel` (and `timeout.accept`, where it was not answered yet). A loop that never
  calls it is covered by an exit hook.
- **`setup` is called once** a runner, however often the tree runs. What is inserted later is set up
  before its first tick, unless it is inserted and ticked in one and the same tick.
- **After a tick that raised**, call `shutdown()` where the loop is your own: `stop(INVALID)` at the
  root does not reach what runs below a composite of py_trees whose first tick this was.
  `TreeRunner` drains by itself.
- **With rclpy's EventsExecutor**, set up and tick on the thread that spins: to make a client on its
  node from another one hangs in rclpy 7.1.5, without this project, too. `TreeRunner` does not
  take it.
- **Callables of yours** (`goal`, `expect`, `retry.when`, `on_feedback`, observers) run on the
  ticking thread.
"""
GROUPS = {
    "Leaves": ["ActionBehaviour", "MoveRobot", "Gripper", "RunTree", "Var"],
    "Composites": ["Recover", "Pipeline", "Every", "InTurn"],
    "Policies": ["Timeouts", "Retry", "Busy"],
    "What became of a goal": ["Outcome", "End", "AttemptRecord", "Progress"],
    "Running": ["load_tree", "TreeRunner", "TreeError", "GoalReport"],
}
DOCUMENT = ["tree_outputs", "tree_inputs", "check_file", "installed_trees", "Finding"]
DOCUMENT += ["DocumentError", "InputError"]
DOCUMENT_HEAD = """\
## Trees from YAML

Beside `load_tree`, from `bt_actions.document`:

```python
root = load_tree("fetch.yaml", {"pick_at": 2.0})
with TreeRunner(root) as runner:
    runner.run()
print(tree_outputs(root)["final_pose"])
```"""
EVENTS = [
    getattr(events, name) for name in events.__all__ if isinstance(getattr(events, name), type)
]
EVENTS_HEAD = """\
## Events

What `TreeRunner.observe` tells, from `bt_actions.events`. All of them are values."""
TESTING = ["VirtualNetwork", "VirtualRunner", "VirtualBackend", "ScriptedServer", "Script"]
TESTING += ["serve_as_recorded", "RecordedServers"]
TESTING_HEAD = """\
## Tests in virtual time

From `bt_actions.testing`; how they are used stands in [testing.md](testing.md)."""
BY_PY_TREES = {"setup", "initialise", "update", "terminate", "shutdown"}
BY_OURSELVES = {
    "Every.due_in",
    "Every.gate",
    "InTurn.work",
    "Pipeline.work",
    "Recover.due_in",
    "Recover.work",
    "ActionBehaviour.due_in",
    "ActionBehaviour.open_handles",
    "Retry.pause",
    "VirtualNetwork.publish",
    "VirtualNetwork.service",
    "VirtualNetwork.topic",
}
"""Public because other parts call them, and of no use to users of the library. Nor is a method
without a docstring: a protocol, or a base class, describes that one."""


def prose(thing: Any) -> str:
    """Return a docstring as Markdown: its ``Args:`` become a list."""
    text = (inspect.getdoc(thing) or "").replace("``", "`")
    before, found, after = text.partition("Args:\n")
    if not found:
        return text
    block, _, rest = after.partition("\n\n")
    listed = []
    for entry in re.split(r"\n(?=\S)", textwrap.dedent(block)):
        name, _, what = " ".join(entry.split()).partition(": ")
        listed.append(f"- `{name}`: {what}")
    return "\n\n".join(part for part in (before.strip(), "\n".join(listed), rest.strip()) if part)


def signature(name: str, call: Any) -> str:
    """Return how something is called, as a block of Python."""
    parameters = inspect.signature(call).parameters.values()
    shown = [each for each in parameters if each.name != "self"]
    one = f"{name}{inspect.Signature(shown)}"
    if len(one) > 88:
        lines, starred = [], False
        for each in shown:
            if each.kind is each.KEYWORD_ONLY and not starred:
                lines.append("*")
                starred = True
            lines.append(str(each))
        one = f"{name}(\n" + "".join(f"    {line},\n" for line in lines) + ")"
    one = re.sub(r": '([^']*)'", r": \1", one)  # annotations are texts
    return f"```python\n{one}\n```"


def fields(kind: type) -> list[tuple[str, str, str]]:
    """Return name, default and meaning of a class's fields, as they stand in its source."""
    (body,) = ast.parse(textwrap.dedent(inspect.getsource(kind))).body
    assert isinstance(body, ast.ClassDef)
    found = []
    for at, node in enumerate(body.body):
        if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            name = node.target.id
            what = ast.unparse(node.annotation)
            default = f" = {ast.unparse(node.value)}" if node.value is not None else ""
        elif isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
            name, what, default = node.targets[0].id, "", ""
        else:
            continue
        after = body.body[at + 1] if at + 1 < len(body.body) else None
        says = ""
        if isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant):
            says = " ".join(str(after.value.value).replace("``", "`").split())
        found.append((name, f"{what}{default}", says))
    return found


def table(kind: type) -> str:
    """Return the fields of a class, or the members of an enumeration, as a table."""
    rows = [(f"`{name}`", f"`{what}`", says) for name, what, says in fields(kind)]
    titles = ("field", "type and default", "meaning")
    if issubclass(kind, Enum):
        rows, titles = [(name, says, "") for name, _, says in rows], ("member", "meaning", "")
    columns = [at for at in range(3) if any(row[at] for row in rows)]
    lines = [[titles[at] for at in columns], ["---"] * len(columns)]
    lines += [[row[at].replace("|", "\\|") for at in columns] for row in rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines) if rows else ""


def members(kind: type) -> str:
    """Return what a class offers beyond its construction: properties and methods."""
    parts = []
    for name, member in vars(kind).items():
        by_py_trees = issubclass(kind, Behaviour) and name in BY_PY_TREES
        said_elsewhere = by_py_trees or not member.__doc__
        if name.startswith("_") or said_elsewhere or f"{kind.__name__}.{name}" in BY_OURSELVES:
            continue
        if isinstance(member, property):
            parts.append(f"- **`{name}`**: {item(member)}")
        elif isinstance(member, classmethod) or inspect.isfunction(member):
            call = getattr(member, "__func__", member)
            shown = [
                each.replace(annotation=each.empty)
                for each in inspect.signature(call).parameters.values()
                if each.name not in ("self", "cls")
            ]
            parts.append(f"- **`{name}{inspect.Signature(shown)}`**: {item(member)}")
    return "\n".join(parts)


def item(member: Any) -> str:
    """Return a docstring as the text of a list's item."""
    return prose(member).replace("\n", "\n  ").replace("\n  \n", "\n\n")


def entry(name: str, thing: Any) -> str:
    """Return the section of one public name."""
    parts = [f"### {name}"]
    if not inspect.isclass(thing):
        parts += [signature(name, thing), prose(thing)]
        return "\n\n".join(parts)
    is_value = issubclass(thing, Enum) or hasattr(thing, "__dataclass_fields__")
    if not is_value and not issubclass(thing, Exception):
        parts.append(signature(name, thing.__init__))
    parts.append(prose(thing))
    if is_value:
        parts.append(table(thing))
    parts.append(members(thing))
    return "\n\n".join(part for part in parts if part)


def page() -> str:
    """Return the whole page."""
    parts = [HEAD]
    for group, names in GROUPS.items():
        parts.append(f"## {group}")
        parts += [entry(name, getattr(bt_actions, name)) for name in names]
    parts.append(DOCUMENT_HEAD)
    parts += [entry(name, getattr(document, name)) for name in DOCUMENT]
    parts.append(EVENTS_HEAD)
    parts += [entry(kind.__name__, kind) for kind in EVENTS]
    parts.append(TESTING_HEAD)
    parts += [entry(name, getattr(testing, name)) for name in TESTING]
    return "\n\n".join(part.rstrip("\n") for part in parts) + "\n"


def main() -> None:
    """Write the page, or check it."""
    fresh = page()
    if sys.argv[1:] == ["--check"]:
        if not PATH.exists() or PATH.read_text(encoding="utf-8") != fresh:
            sys.exit(f"{PATH} is stale: run `python scripts/python_doc.py`")
        return
    PATH.write_text(fresh, encoding="utf-8")


if __name__ == "__main__":
    main()
