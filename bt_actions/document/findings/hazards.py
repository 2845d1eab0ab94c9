"""The rules about hazards, in the form of `rules.py`, and common beginnings of their examples."""

from __future__ import annotations

from functools import partial

from bt_actions.document.findings import Rule, Severity

MOVE = """\
actions:
  move:
    type: robot_control_interfaces/action/MoveRobot
    server: move_robot
    timeout: 30 s
"""
SUCCESS = "root: {success: Done}\n"


def tree(body: str) -> str:
    return "tree: example\n" + body


def moving(body: str) -> str:
    return tree(MOVE + body)


_warning = partial(Rule, severity=Severity.WARNING)
HAZARDS = (
    _warning("BT301", "no result timeout",
        "An action without a result timeout waits for ever on a server that hangs. {result: none} "
        "says that the wait is meant.",
        moving("root: {move: Go}\n").replace("    timeout: 30 s\n", ""),
        moving("root: {move: Go}\n"),
    ),
    _warning("BT302", "a variable is read before anything writes it",
        "When the visit reaches this node, no path through the tree has written the variable. An "
        "action saves its values when it succeeds: they are not there for the next child of a "
        "'fallback'.",
        moving("root:\n  sequence: Work\n  children:\n    - check: $at > 1.0\n"
               "    - move: Go\n      save: {at: result.final_pose}\n"),
        moving("root:\n  sequence: Work\n  children:\n    - move: Go\n"
               "      save: {at: result.final_pose}\n    - check: $at > 1.0\n"),
    ),
    _warning("BT303", "two parallel branches need one resource",
        "Two branches of a 'parallel' need one resource: an action server, or a name in "
        "'resources'. One branch waits for the other, or fails when its queue timeout passes.",
        moving("root:\n  parallel: Both\n  children: [{move: Left}, {move: Right}]\n"),
        moving("root:\n  sequence: One after the other\n  children: [{move: Left},"
               " {move: Right}]\n"),
    ),
    _warning("BT304", "a loop without a limit",
        "A retry without 'attempts' never gives up, and a tree around it never gets on.",
        tree("inputs: {ready: bool}\nroot:\n  retry: Until ready\n  child: {check: $ready}\n"),
        tree("inputs: {ready: bool}\nroot:\n  retry: Until ready\n  attempts: 5\n"
             "  child: {check: $ready}\n"),
    ),
    _warning("BT305", "a child that is never reached",
        "The child before this one always ends the composite: a 'fallback' stops at the first "
        "success, a 'sequence' at the first failure.",
        tree("root:\n  sequence: Work\n  children: [{failure: Give up}, {success: Done}]\n"),
        tree("root:\n  sequence: Work\n  children: [{success: Done}, {failure: Give up}]\n"),
    ),
    _warning("BT306", "a reactive composite starts what takes time again",
        "A composite with 'memory: false' begins with its first child at each tick. A finished "
        "child that takes time thereby starts again while a later child runs: an action is sent, "
        "a service is called, a wait begins. The later child is interrupted, for ever. A child "
        "that may end at once, such as a fallback of a check and an action, is fine.",
        moving("root:\n  sequence: Work\n  memory: false\n  children: [{move: Go}, {wait: 5 s}]\n"),
        moving("inputs: {ready: bool}\nroot:\n  sequence: Work\n  memory: false\n"
               "  children: [{check: $ready}, {move: Go}]\n"),
    ),
    _warning("BT307", "a timeout shorter than what it holds",
        "The node stops its child before the child's own deadlines for results and answers, waits "
        "and retries can pass. The time of an action for its queue, server and acceptance is not "
        "counted.",
        moving("root:\n  timeout: Short\n  after: 5 s\n  child: {move: Go}\n"),
        moving("root:\n  timeout: Long enough\n  after: 40 s\n  child: {move: Go}\n"),
    ),
    _warning("BT308", "an input that nothing uses",
        "Nothing in the tree reads this input, so giving it does nothing.",
        tree("inputs: {speed: float64}\n" + SUCCESS),
        tree("inputs: {speed: float64}\nroot: {check: $speed > 0.0}\n"),
    ),
    _warning("BT309", "an action or a topic that nothing uses",
        "The tree declares an action or a topic that no node uses.",
        moving(SUCCESS),
        moving("root: {move: Go}\n"),
    ),
    _warning("BT310", "a variable that nothing reads",
        "A node writes a variable that nothing reads, and that is no output.",
        tree("root: {set: {count: 1}}\n"),
        tree("outputs: {count: int32}\nroot: {set: {count: 1}}\n"),
    ),
    _warning("BT311", "an output that nothing writes",
        "The tree promises an output that none of its nodes writes.",
        tree("outputs: {count: int32}\n" + SUCCESS),
        tree("outputs: {count: int32}\nroot: {set: {count: 1}}\n"),
    ),
    _warning("BT312", "a loop's item under a name that is taken",
        "A 'for_each' gives its item, or its index, the name of an input, of a topic, or of the "
        "item of a loop around it: a later reader of the name may read the wrong value.",
        tree("inputs: {limit: float64}\nroot:\n  for_each: Limit\n  in: [1.0, 2.0]\n"
             "  as: limit\n  child: {check: $limit > 0.0}\n"),
        tree("inputs: {limit: float64}\nroot:\n  for_each: Item\n  in: [1.0, 2.0]\n"
             "  as: value\n  child: {check: $limit > $value}\n"),
    ),
    _warning("BT313", "a key that not every item has",
        "The items of a list are mappings, and this key is not in every one of them; a reader of "
        "the key fails there. Where such items are meant, ask first: 'at' in $item and $item.at > "
        "1.",
        tree("root:\n  for_each: Stop\n  in: [{at: 1.0}, {to: 2.0}]\n"
             "  child: {check: $item.at > 0.0}\n"),
        tree("root:\n  for_each: Stop\n  in: [{at: 1.0}, {at: 2.0}]\n"
             "  child: {check: $item.at > 0.0}\n"),
    ),
    _warning("BT314", "an inverted check of what nobody may know",
        "A check fails while its topic has no message. Inverted, the failure is a success, "
        "although nobody knows: a door that was never heard of is not open. A 'not' in the check "
        "itself fails as long as there is no value.",
        tree("topics: {door: {topic: door_closed, type: std_msgs/msg/Bool}}\n"
             "root:\n  invert: Open\n  child: {check: $door.data}\n"),
        tree("topics: {door: {topic: door_closed, type: std_msgs/msg/Bool}}\n"
             "root: {check: not $door.data}\n"),
    ),
    _warning("BT315", "a text that holds a variable's name",
        "A text holds the name of a variable as other languages mark it, or a value is nothing "
        "but such names: both stay text. The value of a variable is $name, or $(name) inside a "
        "text, and an expression begins with '= '. Quotes say that a bare name is meant as text.",
        tree('inputs: {part: string}\nroot: {log: "Part {part}"}\n'),
        tree("inputs: {part: string}\nroot: {log: Part $(part)}\n"),
    ),
    _warning("BT316", "a timer that goes by the wall clock",
        "py_trees' own timer reads the wall clock. The timer goes on while a simulator is paused, "
        "jumps with a clock that is set, and would never end in a test in virtual time. 'wait' "
        "goes by the node's clock.",
        tree("root: {python: py_trees.timers.Timer, arguments: {duration: 5.0}}\n"),
        tree("root: {wait: 5 s}\n"),
    ),
    _warning("BT317", "a long duration without a unit",
        "A bare number is seconds. From 500 on, milliseconds are as likely to be meant: other "
        "tools have them. A unit makes the meaning clear.",
        tree("root: {wait: 500}\n"),
        tree("root: {wait: 500 ms}\n"),
    ),
    _warning("BT318", "a large angle without a unit",
        "Roll, pitch and yaw without a unit are radians, and this is more than a full turn. A "
        "unit makes the meaning clear.",
        tree("root:\n  publish: heading\n  type: geometry_msgs/msg/Quaternion\n"
             "  message: {yaw: 90}\n"),
        tree("root:\n  publish: heading\n  type: geometry_msgs/msg/Quaternion\n"
             "  message: {yaw: 90 deg}\n"),
    ),
    _warning("BT319", "a name that holds a variable",
        "The name of a node is fixed when the tree is loaded: a variable in a name is shown as it "
        "is written. A 'log' can show the value.",
        tree("inputs: {part: string}\nroot:\n  sequence: Take $(part)\n"
             "  children: [{check: $part != ''}]\n"),
        tree("inputs: {part: string}\nroot:\n  sequence: Take the part\n"
             "  children: [{log: Take $(part)}]\n"),
    ),
    _warning("BT320", "a branch that fails for the same missing value",
        "A later child of a 'fallback' reads the value without which an earlier child fails. "
        "While the topic has no message, or nothing has written the variable, both fail, and the "
        "later child cannot do its work. A 'wait_until' that a timeout ends fails as a 'check' "
        "does. An action whose goal or 'expect' reads the value may fail for much else, and does "
        "not count as the earlier child. 'known' asks whether there is a value and never fails: "
        "no child behind one that asks gets a warning. A 'log' does not fail either. A later "
        "child that reads the value in a 'check' of its own counts as another case, and gets a "
        "warning only where the first child is no more than a check and no other child is left. "
        "Where nothing can be done without the value, say so with '# bt: ignore[BT320]'.",
        moving("topics: {battery: {topic: battery, type: sensor_msgs/msg/BatteryState}}\n"
               "outputs: {level: float64}\n"
               "root:\n  fallback: Home when it is low\n  children:\n"
               "    - check: $battery.percentage > 0.2\n    - sequence: Home\n      children:\n"
               "        - set: {level: $battery.percentage}\n        - move: Home\n"),
        moving("topics: {battery: {topic: battery, type: sensor_msgs/msg/BatteryState}}\n"
               "outputs: {level: float64}\n"
               "root:\n  fallback: Home when it is low\n  children:\n"
               "    - check: $battery.percentage > 0.2\n    - sequence: Home\n      children:\n"
               "        - force_success: If it is known\n"
               "          child: {set: {level: $battery.percentage}}\n        - move: Home\n"),
    ),
    _warning("BT321", "a comparison with what a field never holds",
        "The field's message fixes its range in a comment, and the number is outside: the "
        "comparison is always true, or always false. The charge of a battery is a fraction: 20 % "
        "are 0.2. The rule knows the charge, the parts of a quaternion, latitude and longitude, "
        "relative humidity, and the variances of a pose, a twist or an acceleration, where the "
        "field itself is compared with a number. A driver may have a number of its own for an "
        "unknown value, such as -1: silence the warning there.",
        tree("topics: {battery: {topic: battery, type: sensor_msgs/msg/BatteryState}}\n"
             "root: {check: $battery.percentage < 20}\n"),
        tree("topics: {battery: {topic: battery, type: sensor_msgs/msg/BatteryState}}\n"
             "root: {check: $battery.percentage < 0.2}\n"),
    ),
    _warning("BT322", "a text in typographic quotes",
        "YAML knows the quotes ' and \" alone. Quotes of chats and word processors are a part of "
        "the text, and are sent with it. Plain quotes around them say that they are meant.",
        tree("root:\n  publish: note\n  type: std_msgs/msg/String\n  message: {data: “map”}\n"),
        tree('root:\n  publish: note\n  type: std_msgs/msg/String\n  message: {data: "map"}\n'),
    ),
    _warning("BT323", "a condition that never changes",
        "The condition reads no variable, so that it is always true, or always false. The branch "
        "that it never chooses can be left away.",
        tree("root:\n  if: true\n  then: {success: Go}\n  else: {success: Stay}\n"),
        tree("inputs: {ready: bool}\nroot:\n  if: $ready\n  then: {success: Go}\n"
             "  else: {success: Stay}\n"),
    ),
    _warning("BT324", "a node that has no effect here",
        "An 'every' holds its child back only where another node begins it again within a visit: "
        "below a 'pipeline', or a 'repeat'. A pipeline of one child has nothing to begin again, "
        "and a goal without variables nothing to follow.",
        tree("root:\n  sequence: Work\n  children:\n"
             "    - every: 1 s\n      child: {success: Plan}\n    - success: Go\n"),
        tree("root:\n  pipeline: Work\n  children:\n"
             "    - every: 1 s\n      child: {success: Plan}\n    - success: Go\n"),
    ),
)  # fmt: skip
