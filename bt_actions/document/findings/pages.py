"""What each rule is about, with a wrong and a right example. The examples are tested.

`bt-actions explain` prints these, and docs/rules.md is made of them.
"""

from __future__ import annotations

import textwrap
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from bt_actions.document.findings.rules import RULES

__all__ = ["PAGES", "Page", "page"]


@dataclass(frozen=True, slots=True)
class Page:
    """The text of a rule with two trees, or for what no tree can show with two commands."""

    text: str
    wrong: str
    right: str

    @property
    def language(self) -> str:
        """What the examples are written in."""
        return "yaml" if self.wrong.startswith(("tree:", "- ")) else "sh"


def page(code: str) -> str:
    """The page of a rule as plain text."""
    rule, said = RULES[code], PAGES[code]
    parts = [f"{code}: {rule.title} ({rule.severity})", "", textwrap.fill(said.text, 88), ""]
    for word, example in (("Wrong", said.wrong), ("Right", said.right)):
        parts += [f"{word}:", "", textwrap.indent(example.rstrip("\n"), "    "), ""]
    return "\n".join(parts)


_MOVE = """\
actions:
  move:
    type: robot_control_interfaces/action/MoveRobot
    server: move_robot
    timeout: 30 s
"""


def _tree(body: str) -> str:
    return "tree: example\n" + textwrap.dedent(body).lstrip("\n")


def _move(body: str) -> str:
    return "tree: example\n" + _MOVE + textwrap.dedent(body).lstrip("\n")


_CAFE = r"printf 'tree: t\nroot: {success: Caf\351}\n' "
_SUCCESS = "root: {success: Done}\n"
PAGES: Mapping[str, Page] = MappingProxyType(
    {
        "BT100": Page(
            "The file is not there, is a directory, may not be read, or is larger than a tree can "
            "be. Trees are found by their path, or by the name of an installed tree. (The examples "
            "are commands of a shell.)",
            "bt-actions check pick_and_plac\n",
            "bt-actions check pick_and_place\n",
        ),
        "BT101": Page(
            "Trees are written in UTF-8, without control characters. Save the file as UTF-8; most "
            "editors can. (The examples are commands of a shell: the é of Latin-1, as it is and "
            "converted.)",
            _CAFE + "| bt-actions check -\n",
            _CAFE + "| iconv -f latin1 -t utf-8 | bt-actions check -\n",
        ),
        "BT102": Page(
            "The text is not YAML, so that nothing else in it can be checked. Most often the "
            "indentation differs from the lines around, or a text with ': ' needs quotes.",
            _tree("root:\n  log: ready: go\n"),
            _tree('root:\n  log: "ready: go"\n'),
        ),
        "BT103": Page(
            "YAML is indented with spaces. Set the editor to insert spaces for the tab key.",
            _tree("root:\n\tsuccess: Done\n"),
            _tree("root:\n  success: Done\n"),
        ),
        "BT104": Page(
            "A key stands twice in one mapping. YAML tools keep one of the two, and not all the "
            "same one.",
            _tree("root:\n  success: Done\n  success: Again\n"),
            _tree("root:\n  success: Done\n"),
        ),
        "BT105": Page(
            "The document is nested deeper than 200 levels, its tree and all that it includes is "
            "more than 200 nodes deep, it stands in more than 50 trees or 100 files, an anchor "
            "holds itself, or aliases and subtrees unfold to more nodes than a tree can have.",
            _tree("root: &loop\n  sequence: Loop\n  children: [*loop]\n"),
            _tree("root:\n  repeat: Loop\n  times: 3\n  child: {success: Done}\n"),
        ),
        "BT106": Page(
            "A tree is one mapping, with a name under 'tree' and its nodes under 'root'. One file "
            "holds one tree.",
            "- success: Done\n",
            _tree(_SUCCESS),
        ),
        "BT107": Page(
            "No such key can stand here. Nothing is ignored silently: a misspelt key would "
            "otherwise do nothing, and nobody would know.",
            _tree("root:\n  sequence: Work\n  memroy: false\n  children: [{success: Done}]\n"),
            _tree("root:\n  sequence: Work\n  memory: false\n  children: [{success: Done}]\n"),
        ),
        "BT108": Page(
            "A key that must be there is missing.",
            _tree("root:\n  invert: Not done\n"),
            _tree("root:\n  invert: Not done\n  child: {success: Done}\n"),
        ),
        "BT109": Page(
            "A value is a list, a mapping or a text where another form is needed. YAML 1.2 reads "
            "'yes', 'no', 'on' and 'off' as texts: write true and false.",
            _tree("root:\n  sequence: Work\n  memory: no\n  children: [{success: Done}]\n"),
            _tree("root:\n  sequence: Work\n  memory: false\n  children: [{success: Done}]\n"),
        ),
        "BT110": Page(
            "The value is of the right form, but cannot be: an unknown word, a duration with an "
            "unknown unit, a number out of its range. Units of time are ns, us, ms, s, sec, min "
            "and h; a bare number is seconds.",
            _tree("root: {wait: 5 sconds}\n"),
            _tree("root: {wait: 5 s}\n"),
        ),
        "BT111": Page(
            "One key of a node says what it is: a kind, or an action that the tree declares. This "
            "node has none.",
            _tree("root: {name: Done}\n"),
            _tree(_SUCCESS),
        ),
        "BT112": Page(
            "One key of a node says what it is; here are two. Most often the dash that begins the "
            "next node is missing.",
            _tree("root:\n  sequence: Work\n  fallback: Else\n  children: [{success: Done}]\n"),
            _tree(
                "root:\n  sequence: Work\n  children:\n    - fallback: Else\n"
                "      children: [{success: Done}]\n"
            ),
        ),
        "BT113": Page(
            "Names of nodes are one line without a colon, since tools that draw trees take 'a:b' "
            "for a port of the node 'a'. Names of variables and actions are letters, digits and "
            "underscores.",
            _tree('root: {success: "Step 1: done"}\n'),
            _tree('root: {success: "Step 1, done"}\n'),
        ),
        "BT114": Page(
            "Expressions are Python's comparisons, arithmetic, and/or/not, 'in', fields and "
            "indices, with len, abs, min and max. A variable is written $name.",
            _tree("inputs: {level: float64}\nroot: {check: $level = 1}\n"),
            _tree("inputs: {level: float64}\nroot: {check: $level == 1}\n"),
        ),
        "BT115": Page(
            "Inside a text, $(name) stands for a value, and $$ for a dollar sign. A value that is "
            "nothing but $name keeps its type.",
            _tree("inputs: {level: float64}\nroot: {log: The level is $level now}\n"),
            _tree("inputs: {level: float64}\nroot: {log: The level is $(level) now}\n"),
        ),
        "BT116": Page(
            "A '#' behind a space begins a comment, wherever it stands. Put the text in quotes "
            "where it belongs to it. Where a space follows the '#', a comment was meant, and "
            "nothing is said; nor is it behind numbers, times and single words of the language.",
            _tree("root: \n  success: Part #3\n"),
            _tree('root: \n  success: "Part #3"\n'),
        ),
        "BT117": Page(
            "In YAML {x} is a mapping of the key x to nothing. A variable is written $x.",
            _move("inputs: {far: float64}\nroot:\n  move: Go\n  goal: {distance: {far}}\n"),
            _move("inputs: {far: float64}\nroot:\n  move: Go\n  goal: {distance: $far}\n"),
        ),
        "BT118": Page(
            "Inside { } and [ ], an unquoted '[' or '{' ends the text before it. Write the index "
            "with a dot, a variable without braces, or put the value in quotes.",
            _move("inputs: {d: 'float64[]'}\nroot:\n  move: Go\n  goal: {distance: $d[0]}\n"),
            _move("inputs: {d: 'float64[]'}\nroot:\n  move: Go\n  goal: {distance: $d.0}\n"),
        ),
        "BT119": Page(
            "An ignore names the warnings it silences: # bt: ignore[BT301] and why. An error "
            "cannot be silenced.",
            _tree("root: {success: Done}  # bt: ignore\n"),
            _tree("root:\n  retry: Ever  # bt: ignore[BT304] an operator stops it\n"
                  "  child: {success: Done}\n"),
        ),
        "BT120": Page(
            "This ignore silences nothing. It may have been of use once; now it would hide what "
            "comes later.",
            _tree("root: {success: Done}  # bt: ignore[BT304] no longer a retry\n"),
            _tree(_SUCCESS),
        ),
        "BT121": Page(
            "The names of topics, services, actions and namespaces are letters, digits and "
            "underscores between slashes; no part begins with a digit. '/' at the beginning makes "
            "a name absolute, '~/' one of the node's own. ROS refuses all others when the tree "
            "starts.",
            _tree("root: {publish: the lamp, type: std_msgs/msg/Bool}\n"),
            _tree("root: {publish: the_lamp, type: std_msgs/msg/Bool}\n"),
        ),
        "BT201": Page(
            "No kind of node has this name, and the tree declares no action of this name.",
            _move("root:\n  sequence: Work\n  children:\n    - mvoe: Go\n    - move: Back\n"),
            _move("root:\n  sequence: Work\n  children:\n    - move: Go\n    - move: Back\n"),
        ),
        "BT202": Page(
            "A tree sees only its own names: its inputs, outputs and topics, and what its nodes "
            "save, set or loop over.",
            _tree("inputs: {level: float64}\nroot: {check: $levle > 0.2}\n"),
            _tree("inputs: {level: float64}\nroot: {check: $level > 0.2}\n"),
        ),
        "BT203": Page(
            "The ROS message that this is about has no field of this name. `ros2 interface show` "
            "prints what it has.",
            _move("root:\n  move: Go\n  goal: {distnace: 2.0}\n"),
            _move("root:\n  move: Go\n  goal: {distance: 2.0}\n"),
        ),
        "BT204": Page(
            "A value does not fit the type that is needed. A whole number is a fine float; a "
            "fraction is no whole number, and a number in quotes is a text.",
            _move('root:\n  move: Go\n  goal: {distance: "2.0"}\n'),
            _move("root:\n  move: Go\n  goal: {distance: 2.0}\n"),
        ),
        "BT205": Page(
            "The package of this action, service or message is not installed here, or has none of "
            "this name. Source the workspace that it is built in, or check with --no-types.",
            "tree: example\n" + _MOVE.replace("MoveRobot", "MoveRobt")
            + "root: {move: Go, goal: {distance: 1.0}}\n",
            _move("root: {move: Go, goal: {distance: 1.0}}\n"),
        ),
        "BT206": Page(
            "An expression does something that the types of its parts do not allow.",
            _tree("inputs: {label: string}\nroot: {check: $label > 1}\n"),
            _tree("inputs: {label: string}\nroot: {check: len($label) > 1}\n"),
        ),
        "BT207": Page(
            "This names no type. Plain types are bool, string, float32, float64, byte, and int and "
            "uint with 8 to 64 bits; others are package/msg/Name. Lists are written float64[], "
            "float64[3] and float64[<=3].",
            _tree("inputs: {level: float}\nroot: {check: $level > 1}\n"),
            _tree("inputs: {level: float64}\nroot: {check: $level > 1}\n"),
        ),
        "BT208": Page(
            "An action's name may not be that of a kind, or of a key that nodes have: nobody could "
            "tell them apart.",
            "tree: example\n" + _MOVE.replace("  move:", "  wait:") + "root: {wait: 5 s}\n",
            _move("root:\n  sequence: Work\n  children: [{move: Go}, {wait: 5 s}]\n"),
        ),
        "BT209": Page(
            "A tree that is included, or a file that is imported, cannot be read. It is looked for "
            "beside this file, then by its name in BT_ACTIONS_TREE_PATH and in the installed "
            "packages.",
            _tree("root: {subtree: no_such_tree.yaml}\n"),
            _tree("root: {subtree: recover}\n"),
        ),
        "BT210": Page(
            "A tree includes itself, directly or by way of others: it would never end. Use "
            "'repeat' or 'retry'.",
            _tree("root: {subtree: wrong.yaml}\n"),
            _tree("root:\n  repeat: Again\n  times: 2\n  child: {success: Done}\n"),
        ),
        "BT211": Page(
            "The tree that is included has an input without a default, and 'with' does not give "
            "it. (The wrong example includes a tree with such an input, needs_input.yaml.)",
            _tree("root: {subtree: needs_input.yaml}\n"),
            _tree("root: {subtree: needs_input.yaml, with: {speed: 1.0}}\n"),
        ),
        "BT212": Page(
            "The tree that is included has no input of this name.",
            _tree("root: {subtree: recover, with: {hoem: 0.0}}\n"),
            _tree("root: {subtree: recover, with: {home: 0.0}}\n"),
        ),
        "BT213": Page(
            "The tree that is included has no output of this name.",
            _tree("outputs: {at: float64}\n"
                  "root: {subtree: pick_and_place, save: {at: final_pos}}\n"),
            _tree("outputs: {at: float64}\n"
                  "root: {subtree: pick_and_place, save: {at: final_pose}}\n"),
        ),
        "BT214": Page(
            "'python' names a class that can be imported here, and that is a py_trees behaviour.",
            _tree("root: {python: py_trees.behaviours.Succes}\n"),
            _tree("root: {python: py_trees.behaviours.Success}\n"),
        ),
        "BT215": Page(
            "The arguments do not fit the constructor of the class. Its name is given by the node.",
            _tree("root: {python: py_trees.timers.Timer, arguments: {duratoin: 1.0}}\n"),
            _tree("root: {python: py_trees.timers.Timer, arguments: {duration: 1.0}}\n"),
        ),
        "BT216": Page(
            "Two things have one name, so that it is not clear which is meant.",
            _tree("inputs: {door: bool}\ntopics: {door: {topic: door, type: std_msgs/msg/Bool}}\n"
                  "root: {check: $door}\n"),
            _tree("topics: {door: {topic: door, type: std_msgs/msg/Bool}}\n"
                  "root: {check: $door.data}\n"),
        ),
        "BT301": Page(
            "An action without a result timeout waits for ever on a server that hangs. Where that "
            "is meant, say so: {result: none}.",
            _move("root: {move: Go}\n").replace("    timeout: 30 s\n", ""),
            _move("root: {move: Go}\n"),
        ),
        "BT302": Page(
            "When this is reached, no path through the tree has written the variable. What an "
            "action saves is there when it has succeeded: not for the next child of a 'fallback'.",
            _move("root:\n  sequence: Work\n  children:\n    - check: $at > 1.0\n"
                  "    - move: Go\n      save: {at: result.final_pose}\n"),
            _move("root:\n  sequence: Work\n  children:\n    - move: Go\n"
                  "      save: {at: result.final_pose}\n    - check: $at > 1.0\n"),
        ),
        "BT303": Page(
            "Two branches of a 'parallel' need one resource: an action server, or what 'resources' "
            "names in its place. One of them waits for the other, or fails when its queue timeout "
            "passes.",
            _move("root:\n  parallel: Both\n  children: [{move: Left}, {move: Right}]\n"),
            _move("root:\n  sequence: One after the other\n  children: [{move: Left},"
                  " {move: Right}]\n"),
        ),
        "BT304": Page(
            "A retry without 'attempts' never gives up, and a tree around it never gets on.",
            _tree("inputs: {ready: bool}\nroot:\n  retry: Until ready\n  child: {check: $ready}\n"),
            _tree("inputs: {ready: bool}\nroot:\n  retry: Until ready\n  attempts: 5\n"
                  "  child: {check: $ready}\n"),
        ),
        "BT305": Page(
            "The child before this one always ends the composite: a 'fallback' stops at the first "
            "success, a 'sequence' at the first failure.",
            _tree("root:\n  sequence: Work\n  children: [{failure: Give up}, {success: Done}]\n"),
            _tree("root:\n  sequence: Work\n  children: [{success: Done}, {failure: Give up}]\n"),
        ),
        "BT306": Page(
            "A composite with 'memory: false' begins with its first child at each tick. What takes "
            "time and has finished is thereby started again while a later child runs: an action "
            "is sent, a service is called, a wait begins. The later child is interrupted, for "
            "ever. A child that may pass without it, such as a fallback of a check and an action, "
            "is fine.",
            _move("root:\n  sequence: Work\n  memory: false\n  children: [{move: Go}, {wait: 5 s}]"
                  "\n"),
            _move("inputs: {ready: bool}\nroot:\n  sequence: Work\n  memory: false\n"
                  "  children: [{check: $ready}, {move: Go}]\n"),
        ),
        "BT307": Page(
            "The node stops what it holds before the deadlines for results and answers, the waits "
            "and the retries in there can pass. What an action may take besides, for its queue, "
            "server and acceptance, is not counted.",
            _move("root:\n  timeout: Short\n  after: 5 s\n  child: {move: Go}\n"),
            _move("root:\n  timeout: Long enough\n  after: 40 s\n  child: {move: Go}\n"),
        ),
        "BT308": Page(
            "Nothing in the tree reads this input, so giving it does nothing.",
            _tree("inputs: {speed: float64}\n" + _SUCCESS),
            _tree("inputs: {speed: float64}\nroot: {check: $speed > 0.0}\n"),
        ),
        "BT309": Page(
            "The tree declares an action or a topic that no node uses.",
            _move(_SUCCESS),
            _move("root: {move: Go}\n"),
        ),
        "BT310": Page(
            "A node writes a variable that nothing reads, and that is no output.",
            _tree("root: {set: {count: 1}}\n"),
            _tree("outputs: {count: int32}\nroot: {set: {count: 1}}\n"),
        ),
        "BT311": Page(
            "The tree promises an output that none of its nodes writes.",
            _tree("outputs: {count: int32}\n" + _SUCCESS),
            _tree("outputs: {count: int32}\nroot: {set: {count: 1}}\n"),
        ),
        "BT312": Page(
            "A 'for_each' gives its item, or its index, the name of an input, of a topic, or of "
            "the item of a loop around it: who reads it afterwards may read the wrong one.",
            _tree("inputs: {limit: float64}\nroot:\n  for_each: Limit\n  in: [1.0, 2.0]\n"
                  "  as: limit\n  child: {check: $limit > 0.0}\n"),
            _tree("inputs: {limit: float64}\nroot:\n  for_each: Item\n  in: [1.0, 2.0]\n"
                  "  as: value\n  child: {check: $limit > $value}\n"),
        ),
        "BT313": Page(
            "The items of a list are mappings, and this key is not in every one of them; what "
            "reads it fails there. Where that is meant, ask first: 'at' in $item and $item.at > 1.",
            _tree("root:\n  for_each: Stop\n  in: [{at: 1.0}, {to: 2.0}]\n"
                  "  child: {check: $item.at > 0.0}\n"),
            _tree("root:\n  for_each: Stop\n  in: [{at: 1.0}, {at: 2.0}]\n"
                  "  child: {check: $item.at > 0.0}\n"),
        ),
        "BT314": Page(
            "A check fails while nothing has come on the topic that it reads. Inverted, that is a "
            "success, although nobody knows: a door that was never heard of is not open. A 'not' "
            "in the check itself fails as long as there is no value.",
            _tree("topics: {door: {topic: door_closed, type: std_msgs/msg/Bool}}\n"
                  "root:\n  invert: Open\n  child: {check: $door.data}\n"),
            _tree("topics: {door: {topic: door_closed, type: std_msgs/msg/Bool}}\n"
                  "root: {check: not $door.data}\n"),
        ),
        "BT315": Page(
            "A text holds the name of a variable as other languages mark it, or a value is nothing "
            "but such names: both stay text. The value of a variable is $name, or $(name) inside a "
            "text, and what is to be computed begins with '= '. Quotes say that a bare name is "
            "meant as text.",
            _tree('inputs: {part: string}\nroot: {log: "Part {part}"}\n'),
            _tree("inputs: {part: string}\nroot: {log: Part $(part)}\n"),
        ),
    }
)  # fmt: skip
"""The page of each rule by its code."""
