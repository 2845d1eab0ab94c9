"""The rules of the checker, each with a wrong and a right example, which are tested.

BT1xx is about the text, BT2xx about names and types, BT3xx (`hazards.py`) about hazards on a robot.
A code never changes. `bt-actions explain` prints the rules, and docs/rules.md is made of them.
"""

from __future__ import annotations

from types import MappingProxyType

from bt_actions.document.findings import Rule, Severity
from bt_actions.document.findings.hazards import HAZARDS, MOVE, SUCCESS, moving, tree

_CAFE = r"printf 'tree: t\nroot: {success: Caf\351}\n' "
_RULES = (
    Rule("BT100", "the file cannot be read",
        "The file does not exist, is a directory, is too large for a tree, or its permissions "
        "forbid reading. A path, or the name of an installed tree, names a tree. (The examples "
        "are commands of a shell.)",
        "bt-actions check pick_and_plac\n",
        "bt-actions check pick_and_place\n",
    ),
    Rule("BT101", "the file is no text",
        "A tree is UTF-8, without control characters. Save the file as UTF-8; most editors can. "
        "(The examples are commands of a shell: an é in Latin-1, and the same é in UTF-8.)",
        _CAFE + "| bt-actions check -\n",
        _CAFE + "| iconv -f latin1 -t utf-8 | bt-actions check -\n",
    ),
    Rule("BT102", "this is not YAML",
        "The text is not YAML, so no other rule can check the file. Most often the indentation "
        "differs from the lines around, or a text with ': ' needs quotes.",
        tree("root:\n  log: ready: go\n"),
        tree('root:\n  log: "ready: go"\n'),
    ),
    Rule("BT103", "a tab cannot indent YAML",
        "YAML is indented with spaces. Set the editor to insert spaces for the tab key.",
        tree("root:\n\tsuccess: Done\n"),
        tree("root:\n  success: Done\n"),
    ),
    Rule("BT104", "a key is here twice",
        "One mapping has a key twice. Some YAML tools would keep the first value, others the last.",
        tree("root:\n  success: Done\n  success: Again\n"),
        tree("root:\n  success: Done\n"),
    ),
    Rule("BT105", "nested too deep, or too large when unfolded",
        "The limits of a document: 200 levels of YAML; 200 levels of nodes, with all included "
        "trees; 50 trees and 100 files; no anchor inside of itself; no more nodes, after aliases "
        "and subtrees are unfolded, than a tree can have.",
        tree("root: &loop\n  sequence: Loop\n  children: [*loop]\n"),
        tree("root:\n  repeat: Loop\n  times: 3\n  child: {success: Done}\n"),
    ),
    Rule("BT106", "the document is not a tree",
        "A tree is one mapping, with a name under 'tree' and its nodes under 'root'. One file "
        "holds one tree.",
        "- success: Done\n",
        tree(SUCCESS),
    ),
    Rule("BT107", "unknown key",
        "This place has no such key. Without the rule, a misspelt key would have no effect, and "
        "nobody would notice.",
        tree("root:\n  sequence: Work\n  memroy: false\n  children: [{success: Done}]\n"),
        tree("root:\n  sequence: Work\n  memory: false\n  children: [{success: Done}]\n"),
    ),
    Rule("BT108", "a key is missing",
        "The mapping lacks a required key.",
        tree("root:\n  invert: Not done\n"),
        tree("root:\n  invert: Not done\n  child: {success: Done}\n"),
    ),
    Rule("BT109", "a value has the wrong form",
        "A value is a list, a mapping or a text where the key takes another form. YAML 1.2 reads "
        "'yes', 'no', 'on' and 'off' as texts: write true and false.",
        tree("root:\n  sequence: Work\n  memory: no\n  children: [{success: Done}]\n"),
        tree("root:\n  sequence: Work\n  memory: false\n  children: [{success: Done}]\n"),
    ),
    Rule("BT110", "a value is out of its range",
        "The value has the right form, but is an unknown word, a duration with an unknown unit, "
        "or a number out of its range. Units of time are ns, us, ms, s, sec, min and h; a bare "
        "number is seconds.",
        tree("root: {wait: 5 sconds}\n"),
        tree("root: {wait: 5 s}\n"),
    ),
    Rule("BT111", "a node without a kind",
        "One key of a node is its kind, or an action that the tree declares. This node has none.",
        tree("root: {name: Done}\n"),
        tree(SUCCESS),
    ),
    Rule("BT112", "a node with two kinds",
        "One key of a node is its kind; here are two. Most often the dash that begins the next "
        "node is missing.",
        tree("root:\n  sequence: Work\n  fallback: Else\n  children: [{success: Done}]\n"),
        tree(
            "root:\n  sequence: Work\n  children:\n    - fallback: Else\n"
            "      children: [{success: Done}]\n"
        ),
    ),
    Rule("BT113", "a name that cannot be used",
        "The name of a node is one line without a colon: tools that draw trees read 'a:b' as a "
        "port of the node 'a'. Names of variables and actions consist of letters, digits and "
        "underscores.",
        tree('root: {success: "Step 1: done"}\n'),
        tree('root: {success: "Step 1, done"}\n'),
    ),
    Rule("BT114", "this is not an expression",
        "Expressions are Python's comparisons, arithmetic, and/or/not, 'in', fields and indices, "
        "with len, abs, min and max. A variable is written $name.",
        tree("inputs: {level: float64}\nroot: {check: $level = 1}\n"),
        tree("inputs: {level: float64}\nroot: {check: $level == 1}\n"),
    ),
    Rule("BT115", "a dollar sign that refers to nothing",
        "Inside a text, $(name) stands for a value, and $$ for a dollar sign. A value that is "
        "nothing but $name keeps its type.",
        tree("inputs: {level: float64}\nroot: {log: The level is $level now}\n"),
        tree("inputs: {level: float64}\nroot: {log: The level is $(level) now}\n"),
    ),
    Rule("BT116", "a text was cut by '#'",
        "A '#' after a space begins a comment, also inside of a text. Put a text with a '#' in "
        "quotes. A '#' with a space on both sides gets no warning, and neither does a '#' after "
        "numbers, times and single words of the language.",
        tree("root: \n  success: Part #3\n"),
        tree('root: \n  success: "Part #3"\n'),
        Severity.WARNING,
    ),
    Rule("BT117", "{x} is a mapping",
        "In YAML {x} is a mapping of the key x to nothing. A variable is written $x.",
        moving("inputs: {far: float64}\nroot:\n  move: Go\n  goal: {distance: {far}}\n"),
        moving("inputs: {far: float64}\nroot:\n  move: Go\n  goal: {distance: $far}\n"),
    ),
    Rule("BT118", "an unquoted text inside { } or [ ] holds [ or {",
        "Inside { } and [ ], an unquoted '[' or '{' ends the text before it. Write the index with "
        "a dot, a variable without braces, or put the value in quotes.",
        moving("inputs: {d: 'float64[]'}\nroot:\n  move: Go\n  goal: {distance: $d[0]}\n"),
        moving("inputs: {d: 'float64[]'}\nroot:\n  move: Go\n  goal: {distance: $d.0}\n"),
    ),
    Rule("BT119", "an ignore that names no rule",
        "An ignore names the warnings that it silences: # bt: ignore[BT301] and the reason. No "
        "ignore silences an error.",
        tree("root: {success: Done}  # bt: ignore\n"),
        tree("root:\n  retry: Ever  # bt: ignore[BT304] an operator stops it\n"
             "  child: {success: Done}\n"),
    ),
    Rule("BT120", "an ignore that silences nothing",
        "No warning needs this ignore any more. Remove the ignore, as it would hide a later "
        "finding.",
        tree("root: {success: Done}  # bt: ignore[BT304] no longer a retry\n"),
        tree(SUCCESS),
    ),
    Rule("BT121", "a name that ROS does not take",
        "The names of topics, services, actions and namespaces are letters, digits and underscores"
        " between slashes; no part begins with a digit. '/' at the beginning makes a name "
        "absolute, '~/' one of the node's own. ROS refuses other names when the tree starts.",
        tree("root: {publish: the lamp, type: std_msgs/msg/Bool}\n"),
        tree("root: {publish: the_lamp, type: std_msgs/msg/Bool}\n"),
    ),
    Rule("BT201", "unknown kind or action",
        "No kind of node has this name, and the tree declares no action of this name.",
        moving("root:\n  sequence: Work\n  children:\n    - mvoe: Go\n    - move: Back\n"),
        moving("root:\n  sequence: Work\n  children:\n    - move: Go\n    - move: Back\n"),
    ),
    Rule("BT202", "unknown variable",
        "A tree sees only its own names: its inputs, outputs and topics, and the variables that "
        "its nodes save, set or loop over.",
        tree("inputs: {level: float64}\nroot: {check: $levle > 0.2}\n"),
        tree("inputs: {level: float64}\nroot: {check: $level > 0.2}\n"),
    ),
    Rule("BT203", "a message has no such field",
        "The ROS message has no field of this name. `bt-actions interfaces show TYPE` "
        "prints its fields.",
        moving("root:\n  move: Go\n  goal: {distnace: 2.0}\n"),
        moving("root:\n  move: Go\n  goal: {distance: 2.0}\n"),
    ),
    Rule("BT204", "a value does not fit its type",
        "The field or variable has another type than the value. A float takes a whole number, an "
        "integer takes no fraction, and a number in quotes is a text.",
        moving('root:\n  move: Go\n  goal: {distance: "2.0"}\n'),
        moving("root:\n  move: Go\n  goal: {distance: 2.0}\n"),
    ),
    Rule("BT205", "a type is not installed",
        "The package of this action, service or message is not installed here, or has no type of "
        "this name. `bt-actions interfaces list` prints the installed types. Source the workspace "
        "of the package; without a workspace, `bt-actions interfaces build PATH` builds and "
        "installs the package from its sources. `check --no-types` does not look for types.",
        "tree: example\n" + MOVE.replace("MoveRobot", "MoveRobt")
        + "root: {move: Go, goal: {distance: 1.0}}\n",
        moving("root: {move: Go, goal: {distance: 1.0}}\n"),
    ),
    Rule("BT206", "an expression does not fit its types",
        "The types of the parts do not allow this operation.",
        tree("inputs: {label: string}\nroot: {check: $label > 1}\n"),
        tree("inputs: {label: string}\nroot: {check: len($label) > 1}\n"),
    ),
    Rule("BT207", "unknown type",
        "No type has this name. Plain types are bool, string, float32, float64, byte, and int and "
        "uint with 8 to 64 bits; others are package/msg/Name. Lists are written float64[], "
        "float64[3] and float64[<=3].",
        tree("inputs: {level: float}\nroot: {check: $level > 1}\n"),
        tree("inputs: {level: float64}\nroot: {check: $level > 1}\n"),
    ),
    Rule("BT208", "an action's name hides a kind or a key of nodes",
        "An action has the name of a kind, or of a key of nodes. A node with that key would have "
        "two meanings.",
        "tree: example\n" + MOVE.replace("  move:", "  wait:") + "root: {wait: 5 s}\n",
        moving("root:\n  sequence: Work\n  children: [{move: Go}, {wait: 5 s}]\n"),
    ),
    Rule("BT209", "a tree that is included cannot be read",
        "An included tree, or an imported file, cannot be read. The search looks beside this file, "
        "then for the name in BT_ACTIONS_TREE_PATH and in the installed packages.",
        tree("root: {subtree: no_such_tree.yaml}\n"),
        tree("root: {subtree: recover}\n"),
    ),
    Rule("BT210", "a tree that includes itself",
        "A tree includes itself, directly or by way of others: the tree would never end. Use "
        "'repeat' or 'retry'.",
        tree("root: {subtree: wrong.yaml}\n"),
        tree("root:\n  repeat: Again\n  times: 2\n  child: {success: Done}\n"),
    ),
    Rule("BT211", "an input is missing",
        "The included tree has an input without a default, and 'with' has no value for the input. "
        "(The wrong example includes a tree with such an input, needs_input.yaml.)",
        tree("root: {subtree: needs_input.yaml}\n"),
        tree("root: {subtree: needs_input.yaml, with: {speed: 1.0}}\n"),
    ),
    Rule("BT212", "unknown input",
        "The included tree has no input of this name.",
        tree("root: {subtree: recover, with: {hoem: 0.0}}\n"),
        tree("root: {subtree: recover, with: {home: 0.0}}\n"),
    ),
    Rule("BT213", "unknown output",
        "The included tree has no output of this name.",
        tree("outputs: {at: float64}\nroot: {subtree: pick_and_place, save: {at: final_pos}}\n"),
        tree("outputs: {at: float64}\nroot: {subtree: pick_and_place, save: {at: final_pose}}\n"),
    ),
    Rule("BT214", "a class cannot be used as a behaviour",
        "'python' names no py_trees behaviour that Python can import here.",
        tree("root: {python: py_trees.behaviours.Succes}\n"),
        tree("root: {python: py_trees.behaviours.Success}\n"),
    ),
    Rule("BT215", "arguments do not fit",
        "The arguments do not fit the constructor of the class. The constructor also gets the "
        "name of the node. For a parameter with an enum as its type, the argument is the name of "
        "a member.",
        tree("root: {python: py_trees.behaviours.Periodic, arguments: {number: 3}}\n"),
        tree("root: {python: py_trees.behaviours.Periodic, arguments: {n: 3}}\n"),
    ),
    Rule("BT216", "a name is declared twice",
        "Two declarations have the same name.",
        tree("inputs: {door: bool}\ntopics: {door: {topic: door, type: std_msgs/msg/Bool}}\n"
             "root: {check: $door}\n"),
        tree("topics: {door: {topic: door, type: std_msgs/msg/Bool}}\n"
             "root: {check: $door.data}\n"),
    ),
    Rule("BT217", "one name with two types",
        "An action server, a service or a topic has one type. This tree, with its included trees, "
        "uses the name with two types, and ROS would not connect the second one. The rule reads a "
        "relative name in the namespace /. Where 'robot' and '/robot' differ, give the tree its "
        "'namespace'.",
        tree("root:\n  sequence: S\n  children:\n"
             "    - {publish: said, type: std_msgs/msg/String}\n"
             "    - {publish: said, type: std_msgs/msg/Bool}\n"),
        tree("root:\n  sequence: S\n  children:\n"
             "    - {publish: said, type: std_msgs/msg/String}\n"
             "    - {publish: on, type: std_msgs/msg/Bool}\n"),
    ),
)  # fmt: skip
RULES = MappingProxyType({rule.code: rule for rule in (*_RULES, *HAZARDS)})
"""Every rule by its code."""
