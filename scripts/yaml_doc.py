"""Writes docs/yaml.md and docs/rules.md from the model of the tree language.

`python scripts/yaml_doc.py` writes them; with `--check` it exits 1, and says so, when one is stale.
"""

from __future__ import annotations

import ast
import inspect
import itertools
import re
import sys
import textwrap
from collections.abc import Iterable, Iterator
from pathlib import Path

from bt_actions.document.findings.rules import RULES
from bt_actions.document.kinds import KINDS
from bt_actions.document.language.keys import (
    ALIAS,
    DOING,
    GATES,
    INPUT,
    OUTPUT,
    OWN_KIND,
    RETRY,
    SERVICE_RETRY,
    SERVICE_TIMEOUT,
    TIMEOUT,
    TOP_KEYS,
    TOPIC,
)
from bt_actions.document.language.kinds import Group, Kind
from bt_actions.document.language.scalars import Shape, Text
from bt_actions.document.language.shapes import Key, Record
from bt_actions.expressions.functions import ARGUMENTS
from bt_actions.goals.policy import RETRIED_BY_DEFAULT, RETRIED_IF_NAMED, Busy
from bt_actions.utilities.units import DURATION_UNITS

ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / "docs"
EXAMPLES = ROOT / "examples"
RULES_FILE = "bt_actions/document/findings/rules.py"

FUNCTIONS = {
    "len": "`len($list)` | the number of items, characters or keys",
    "abs": "`abs($x)` | a number without its sign",
    "min": "`min($list)`, `min($a, $b)` | the least number or text",
    "max": "`max($list)`, `max($a, $b)` | the greatest number or text",
    "round": "`round($x)`, `round($x, 2)` | the nearest whole number, or so many digits",
    "sqrt": "`sqrt($x)` | the square root of a number that is not negative",
    "int": "`int($x)` | a number without its fraction; the whole number that a text holds",
    "float": "`float($x)` | the number that a text holds",
    "str": "`str($x)` | a number, true or false as a text",
    "known": "`known($x)`, `known($door.data)` | whether there is a value; never fails",
}
"""The calls and the values of each function of expressions."""
ROWS = "\n".join(f"| {FUNCTIONS[name]} |" for name in ARGUMENTS)

HEAD = f"""\
# Trees in YAML

<!-- Made by scripts/yaml_doc.py from bt_actions/document/language/. Do not edit. -->

A tree is a YAML file. `bt-actions check` finds mistakes in the file before a robot moves,
`bt-actions format` puts the file in canonical form, and `bt-actions schema` prints a JSON Schema
for completion in editors. The files on this page are in `examples/`.

@fetch

## Rules

- A node is a mapping with **exactly one key that is a kind, or the name of an action** that the
  tree declares. The order of keys is free.
- The value of most kinds is the name of the node, which has no colon. The value of other kinds
  says what the node does (`wait: 5 s`), and such a node may have a `name:`. The section of a kind
  says which.
- `timeout` and `retry` are settings beside an action, and kinds of nodes beside `child:`.
- Unknown keys, double keys and values of the wrong form are errors.
- Scalars follow YAML 1.2: `on` and `yes` are texts, U+2028, U+2029 and U+0085 end no line,
  and in double quotes the two halves that JSON writes (`"\\ud83d\\ude00"`) are one character.
  libyaml reads the files, and comes with the wheels of PyYAML.
- Durations carry a unit ({", ".join(f"`{unit}`" for unit in DURATION_UNITS)}); a bare number is
  seconds, with a warning from 500 on. Deadlines and pauses are never negative. Where a
  limit is optional, `none` means no limit.
- Numbers and durations are constants, so that `check` knows deadlines before a robot moves. Where
  a variable is possible, the tables say "or `$name`".

## Values

| written | means |
|---|---|
| `$name`, `$name.field.0` | the value, with its type |
| `Part $(name)` | a text with the value in it |
| `= $a + 1` | an expression, computed on demand |
| `$$` | a dollar sign |
| `"@points.yaml"` | the data in a file beside the tree: for large values (.yaml, .yml, .json) |

A tree sees only its own names: inputs, outputs, topics, and the names that its nodes `save`, `set`
or loop over. A subtree gets the values of `with`, and gives back outputs by `save`. Each visit of a
subtree begins without the values of the visit before, except values that a node below a `run_once`
wrote. An output without a value does not change the variable of the caller.

A variable without a value makes a goal INVALID_GOAL, and a check FAILURE, with the reason. A `log`
writes `(no value)`. `known($name)` tells whether the variable has a value.

Types of inputs and outputs are `bool`, `string`, `float32`, `float64`, `byte`, `int8` to `int64`,
`uint8` to `uint64`, any `package/msg/Name`, and lists of them: `float64[]`, `float64[3]`,
`float64[<=3]`. A float takes a whole number, but an integer takes no fraction. Goals and messages
may hold `.inf` and `.nan`; inputs are finite. A mapping in a tree (`set: {{stop: {{at: 2.0}}}}`,
the items of a `for_each`) has its own keys (`$stop.at`), and may fill a message. The name of a node
is constant: a `$name` in a node's name has no effect.

Expressions have Python's comparisons, arithmetic, `and`, `or`, `not`, `in`, fields, indices and
slices (`$list[-1]`, `$list[1:3]`), `1 if $empty else 2`, `true` and `false`, and constants
(`MoveRobot.Result.STATUS_FAULT`). A plus sign also joins two texts, and two lists:
`= $names + ['part ' + str($count)]`. In `expect`, `save` and `when` the bare name `result` is the
result, and in a `run_tree` the name `outputs` has the outputs of the tree. In `until` and
`save_feedback` of an action, `feedback` is the feedback. In `until` and `save` of
`wait_for_message`, `message` is the message. A float32 has the value of its shortest decimal: 0.7,
not 0.699999988. The functions are:

| function | gives |
|---|---|
{ROWS}

Some fields of messages have short forms. Variables that fill such a field may have them, too,
except `now` and constants:

| field | short forms |
|---|---|
| builtin_interfaces/Time | `now`, seconds, or `{{sec, nanosec}}` |
| builtin_interfaces/Duration | `500 ms`, `-1 s`, seconds, or `{{sec, nanosec}}` |
| geometry_msgs/Quaternion | `{{yaw: 90 deg}}` (`$a`: radians), `roll`, `pitch`; or its fields |
| a number with constants | `STATUS_MOVING`, `MoveRobot.Feedback.STATUS_MOVING`, `pkg/msg/X.NAME` |

@messages

## Silencing a warning

Write `# bt: ignore[BT301] why` on the line, or alone on a line above. No comment silences an error.
[rules.md](rules.md) has the rules, and `bt-actions explain BT301` prints one.

"""
RULES_HEAD = """\
A finding names its place and its rule: `fetch.yaml:10:13: error[BT203]: ...`. `bt-actions explain
BT203` prints the section of that rule from this page. A tree with an error does not run; a tree
with warnings does. `# bt: ignore[BT301] why` on a line silences a warning there, never an error.

## The most common findings

| code | finding | what to do |
|---|---|---|"""
FIRST_MET = {
    "BT102": "indent as the lines around; put a text that holds `: ` in quotes",
    "BT107": "mend the spelling; [yaml.md](yaml.md) has the keys of each kind",
    "BT201": "name the action under `actions`, or mend the spelling of the kind",
    "BT202": "declare the variable under `inputs` or `topics`, or `save` or `set` one before",
    "BT203": "`bt-actions interfaces show TYPE` has the fields",
    "BT205": "build the package ([interfaces.md](interfaces.md)), or source its workspace",
    "BT301": "give the action a `timeout`; without one the tree waits for a lost robot for ever",
    "BT306": "remove `memory: false`",
}
"""The rules that beginners meet, and the remedy of each in a line."""

ALIAS_HEAD = """\
### An action by its name

The key is a name under `actions`, its value the node's name.

```yaml
%s
```
"""
ALIAS_EXAMPLE = "move: To the part\ngoal: {distance: 2.0}\nretry: 3"
IMPORT = """\
`import` adds the `actions`, `topics`, `kinds` and `defaults` of other files. The search for such a
file is that for a [subtree](#where-trees-are-found). A `$name` in the file is a variable of the
importing tree."""
WHERE = """\
## Where trees are found

Paths in `subtree:` and `import:` begin at the folder of their own file. Paths for `bt-actions` and
`load_tree` begin at the current folder. You may leave `.yaml` and `.yml` away.

A name without a folder, and without a file of that name, stands for an installed tree. The search
goes through the folders of `BT_ACTIONS_TREE_PATH` (separated as in `PATH`), the trees of
bt_actions, and `share/PACKAGE/trees` of every package in the sourced ROS workspaces, in this order.
A package of yours installs its trees there, with its `setup.py` or CMakeLists.txt.
`package://PACKAGE/trees/NAME.yaml` names a tree of one package.
"""
BUSY = """\
`busy` says what a goal does when another goal of this process has its server, or one of its
`resources`:

| `busy` | the goal |
|---|---|
"""
ON_CHANGE = """\
Each tick computes the fields of the goal anew while the goal executes. `on_change` says what the
leaf does when they differ from the fields of the sent goal (`now` does not count):

| `on_change` | the leaf |
|---|---|
| `ignore` | keeps its goal |
| `replace` | sends the new goal at once; the leaf cancels the old goal after `timeout.cancel`, \
or at its own end |
| `cancel` | cancels the goal, and sends the new one after the end of the old one |

The node stays RUNNING, and only the end of the newest goal counts. `timeout.result` runs on, and a
replacement uses no attempt. When a new goal cannot be built, the old goal runs on. When the server
refuses a new goal, the leaf cancels the old one, and the attempt ends. At most two goals live at
once: a further change waits, and the newest change counts. On a `subtree`, `on_change: pass` passes
changed inputs on.
"""
SAVE_FEEDBACK = """\
Each feedback writes its variables as the feedback comes, also the feedback of a goal that fails.
Before the first feedback a variable has the value that it had, or none (`known($name)` asks). A
part that a feedback lacks leaves its variable as it was. The leaf asks `until` before the write, so
`until: feedback.left > $left` compares with the feedback before.
"""
QOS = """\
### `qos`

| `qos` | quality of service |
|---|---|
| `default` | reliable, the last 10 messages, none from before the subscription |
| `sensor` | best effort, the last 5 messages: ROS's profile for sensor data |
| `latched` | reliable, and a later subscriber gets the last message |
| `best_effort` | as `default`, but best effort |
| `services` | ROS's profile for services |

A subscription gets no message where it asks for more than the publisher offers: `default` and
`latched` with a best effort publisher, and `latched` with a publisher that keeps no message.
"""
OWN_KINDS = """\
A class of your own may be a kind: `shorten: A metre` with `with: {path: $path}`, `save: {short:
path}`, and `child` or `children`. The class is a behaviour of py_trees, made with its name, and its
`child` or `children`. The class reads `self.inputs.path`, computed at that moment, and sets
`self.outputs.path`. The node writes all outputs at the end of the visit, or none. Where an input
has no value, or an output does not fit, the node fails."""
TOPICS = """\
The variable of a topic has the latest message. A node that reads the variable is `RUNNING` while
the first message may still be on its way: in the first 3.5 s of the process, and for a second after
a subscription to a publisher in sight. Afterwards the message counts as missing, and a check fails.

Without a message `check: not $door.data` fails, too. An `invert` around `check: $door.data`
succeeds, as its child has failed. `check: not known($door)` begins a branch for a topic without a
message."""
DEFAULTS = """\
`defaults` has `timeout`, `retry` and `busy` for all actions. Settings merge key by key, and the
nearest wins: first those of the node, then those under `actions`, the `defaults` of the tree, the
`defaults` of an imported file."""
NAMESPACE = """\
The name of an action, a service or a topic is relative where the name begins without a slash. A
relative name stands in the namespaces of the ROS node, of the trees around the leaf, and of the
leaf itself.

`$(robot)` in a name, or in a namespace, is an input of type string: `server: $(robot)/move`. The
value must be known before the tree runs. So `robot` is an input of the root tree, or an input of a
subtree whose `with` gives a constant or such an input."""
LEFT_OUT = """\
Both may stand beside any kind. A node is left out in three cases:

- `only_if` is false at the begin of the node.
- `only_while` is false before a tick. The node stops all nodes below, and is `RUNNING` until their
  goals have ended.
- All of its children were left out.

The parent goes on as if the node were not there:

| parent | reaction |
|---|---|
| `sequence`, `pipeline`, `fallback` | goes on to the next child |
| `parallel` | computes the condition again at each tick; meanwhile the node counts for `all`, \
not for `at_least` |
| `repeat` without `times` | stays RUNNING, and computes the condition at the next tick |
| `for_each` | goes on to the next item; the item has neither succeeded nor failed |
| any other decorator, `if`, `subtree` | is left out, too |
| `recover` of a `retry` | the retry fails |
| the root | SUCCESS |

A condition waits for the first message of a topic, as a `check` does. Afterwards a condition
without a value fails the node: `known($door)` asks for a value. py_trees has no status for a node
that is left out. Its status is SUCCESS below a sequence and FAILURE below a fallback, with the
reason as its message (`left out: $near is false`).
"""
SHOWN = {"if": "recovering", "pipeline": "following"}
"""The examples that stand below the last of their kinds."""
TITLES = {
    Group.COMPOSITE: "Composites",
    Group.DECORATOR: "Decorators",
    Group.LEAF: "Leaves",
}


def table(keys: Iterable[Key]) -> list[str]:
    """Return a table of keys."""
    lines = ["| key | value | meaning | default |", "|---|---|---|---|"]
    for key in keys:
        words = form(key.shape).replace("|", "\\|")
        default = "**required**" if key.required else (key.default or "")
        lines.append(f"| `{key.name}` | {words} | {key.doc} | {default} |")
    return [*lines, ""]


def form(shape: Shape) -> str:
    """Return the words of a shape."""
    words = shape.words.rstrip(",")
    if getattr(shape, "single", False):
        words = f"{words}, or one item of it"
    if getattr(shape, "values", False) and not isinstance(shape, Text):
        words = f"{words}, or `$name`"
    return words


def example(name: str) -> str:
    """Return a tree in examples/, which a test runs."""
    text = (EXAMPLES / f"{name}.yaml").read_text(encoding="utf-8")
    return f"```yaml\n{text}```"


def record(title: str, text: str, shape: Record) -> list[str]:
    """Return a section about a mapping that stands in several places."""
    return [f"### {title}", "", text, "", *table(shape.keys.values())]


def part(title: str, text: str, *names: str) -> list[str]:
    """Return a section about a part of a file, with examples."""
    return [f"### {title}", "", text, "", *(line for name in names for line in (example(name), ""))]


def section(kind: Kind) -> list[str]:
    """Return the section of a kind."""
    value = "the node's name" if kind.named_by_value else form(kind.value)
    own = [key for name, key in kind.keys.items() if name not in GATES]
    return [
        f"### `{kind.name}`", "", kind.doc, "", f"`{kind.name}:` is {value}.", "",
        "```yaml", kind.example, "```", "", *(table(own) if own else []),
        *([*kind.semantics.strip().split("\n"), ""] if kind.semantics else []),
    ]  # fmt: skip


def busy() -> list[str]:
    """Return the rows about a goal whose server is taken."""
    words = dict(attribute_docs(Busy))
    return [f"| `{busy.value}` | {words[busy.name]} |" for busy in Busy]


def attribute_docs(cls: type) -> Iterator[tuple[str, str]]:
    """Yield the names of a class's attributes, with the text below each."""
    (body,) = ast.parse(textwrap.dedent(inspect.getsource(cls))).body
    assert isinstance(body, ast.ClassDef)
    for assigned, text in itertools.pairwise(body.body):
        if isinstance(assigned, ast.Assign) and isinstance(text, ast.Expr):
            assert isinstance(assigned.targets[0], ast.Name)
            yield assigned.targets[0].id, ast.literal_eval(text.value)


def retry_text() -> str:
    """Return the meaning of a retry, with the outcomes that count by default."""

    def listed(outcomes: Iterable[str]) -> str:
        *most, last = (f"`{outcome}`" for outcome in sorted(outcomes))
        return f"{', '.join(most)} and {last}"

    return (
        "`3` is short for `{attempts: 3}`. Without `outcomes`, another attempt follows "
        f"{listed(RETRIED_BY_DEFAULT)}. After {listed(RETRIED_IF_NAMED)} the server may have "
        "executed the goal, so another attempt follows only where `outcomes` names them. "
        "[goal.md](goal.md#outcomes-and-ends) explains each outcome."
    )


def yaml_page() -> str:
    """Return docs/yaml.md."""
    head = re.sub(
        r"^@(\w+)$", lambda match: example(match[1]), HEAD.rstrip("\n"), flags=re.MULTILINE
    )
    lines = [head, "", "## The file", "", *table(TOP_KEYS.values())]
    lines += record("`inputs`", "An input is a mapping, or only its type.", INPUT)
    lines += record("`outputs`", "An output is a mapping, or only its type.", OUTPUT)
    lines += record(
        "`actions`",
        "A setting of a leaf wins over the setting here, and the setting here over `defaults`.",
        ALIAS,
    )  # fmt: skip
    lines += record("`topics`", TOPICS, TOPIC)
    lines += [example("topics"), ""]
    lines += [*record("`kinds`", OWN_KINDS, OWN_KIND), example("own_kinds"), ""]
    lines += part("`import`", IMPORT, "words", "imports")
    lines += part("`defaults`", DEFAULTS, "defaults")
    lines += part("`namespace`", NAMESPACE, "namespaces")
    lines += ["### `busy`", "", BUSY + "\n".join(busy()), ""]
    lines += ["### `on_change` of an action", "", *ON_CHANGE.split("\n"), example("guided"), ""]
    lines += part("`save_feedback` of an action", SAVE_FEEDBACK.rstrip("\n"), "on_the_way")
    lines += [*QOS.split("\n")]
    lines += record("`timeout` of an action", "`30 s` is short for `{result: 30 s}`.", TIMEOUT)
    lines += record("`retry` of an action", retry_text(), RETRY)
    text = "`5 s` is short for `{response: 5 s}`."
    lines += record("`timeout` of a service", text, SERVICE_TIMEOUT)
    lines += record("`retry` of a service", "As for an action.", SERVICE_RETRY)
    lines += WHERE.split("\n")
    lines += ["## What is left out", "", *table(GATES.values()), *LEFT_OUT.split("\n")]
    for group, title in TITLES.items():
        lines += [f"## {title}", ""]
        if group is Group.LEAF:
            lines += [*(ALIAS_HEAD % ALIAS_EXAMPLE).split("\n"), *table(DOING)]
        for kind in KINDS.values():
            if kind.group is group:
                lines += section(kind)
                lines += [example(SHOWN[kind.name]), ""] if kind.name in SHOWN else []
    return "\n".join(lines).rstrip("\n") + "\n"


def rules_page() -> str:
    """Return docs/rules.md."""
    lines = [
        "# The rules of `bt-actions check`", "",
        f"<!-- Made by scripts/yaml_doc.py from {RULES_FILE}. Do not edit. -->", "",
        *RULES_HEAD.split("\n"),
        *(f"| [{code}](#{code.lower()}) | {RULES[code].title} | {remedy} |"
          for code, remedy in FIRST_MET.items()), "",
        "## All rules", "",
        "| code | severity | finding |", "|---|---|---|",
        *(f"| [{rule.code}](#{rule.code.lower()}) | {rule.severity} | {rule.title} |"
          for rule in RULES.values()), "",
    ]  # fmt: skip
    for code, rule in RULES.items():
        lines += [f"## {code}", "", f"*{rule.severity}*: {rule.title}", "", rule.text, ""]
        for word, example in (("Wrong", rule.wrong), ("Right", rule.right)):
            lines += [f"{word}:", "", f"```{rule.language}", example.rstrip("\n"), "```", ""]
    return "\n".join(lines).rstrip("\n") + "\n"


PAGES_BY_PATH = {DOCS / "yaml.md": yaml_page, DOCS / "rules.md": rules_page}


def main() -> int:
    """Write the pages, or check them."""
    stale = False
    for path, make in PAGES_BY_PATH.items():
        if "--check" in sys.argv[1:]:
            if not path.is_file() or path.read_text(encoding="utf-8") != make():
                print(f"{path} is stale: run `python scripts/yaml_doc.py`", file=sys.stderr)
                stale = True
        else:
            path.write_text(make(), encoding="utf-8")
    return 1 if stale else 0


if __name__ == "__main__":
    sys.exit(main())
