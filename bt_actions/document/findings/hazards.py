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
        "An action without a result timeout waits for ever for a server that hangs. Write "
        "{result: none} for a wait without limit.",
        moving("root: {move: Go}\n").replace("    timeout: 30 s\n", ""),
        moving("root: {move: Go}\n"),
    ),
    _warning("BT302", "a variable is read before anything writes it",
        "No path through the tree to this node writes the variable first. An action saves its "
        "values when it succeeds, so the next child of a 'fallback' does not have them.",
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
        "A retry without 'attempts' never gives up, and the tree around the retry never goes on.",
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
    _warning("BT306", "a composite with 'memory: false' begins an action again that has ended",
        "A composite with 'memory: false' begins with its first child at each tick. So an action, "
        "a service or a wait that has succeeded begins again while a later child runs, and stops "
        "the later child, for ever. A child that may end at once, such as a fallback of a check "
        "and an action, gets no warning.",
        moving("root:\n  sequence: Work\n  memory: false\n  children: [{move: Go}, {wait: 5 s}]\n"),
        moving("inputs: {ready: bool}\nroot:\n  sequence: Work\n  memory: false\n"
               "  children: [{check: $ready}, {move: Go}]\n"),
    ),
    _warning("BT307", "a timeout shorter than the deadlines inside",
        "The node stops its child before the deadlines for results and answers, the waits and the "
        "retries inside can pass. The rule does not count the time of an action for queue, server "
        "and acceptance.",
        moving("root:\n  timeout: Short\n  after: 5 s\n  child: {move: Go}\n"),
        moving("root:\n  timeout: Long enough\n  after: 40 s\n  child: {move: Go}\n"),
    ),
    _warning("BT308", "an input that nothing uses",
        "No node of the tree reads this input, so its value has no effect.",
        tree("inputs: {speed: float64}\n" + SUCCESS),
        tree("inputs: {speed: float64}\nroot: {check: $speed > 0.0}\n"),
    ),
    _warning("BT309", "an action or a topic that nothing uses",
        "The tree declares an action or a topic that no node uses.",
        moving(SUCCESS),
        moving("root: {move: Go}\n"),
    ),
    _warning("BT310", "a variable that nothing reads",
        "A node writes a variable that no node reads, and that is no output.",
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
    _warning("BT313", "a key that some items lack",
        "The items of a list are mappings, and some of them lack this key. A node that reads the "
        "key fails there. For such items, ask first: 'at' in $item and $item.at > 1.",
        tree("root:\n  for_each: Stop\n  in: [{at: 1.0}, {to: 2.0}]\n"
             "  child: {check: $item.at > 0.0}\n"),
        tree("root:\n  for_each: Stop\n  in: [{at: 1.0}, {at: 2.0}]\n"
             "  child: {check: $item.at > 0.0}\n"),
    ),
    _warning("BT314", "an inverted check of a topic that may be silent",
        "A check fails while its topic has no message, and 'invert' makes a success of that "
        "failure. So the tree takes a door without a message for open. Write 'not' in the check, "
        "which also fails without a message.",
        tree("topics: {door: {topic: door_closed, type: std_msgs/msg/Bool}}\n"
             "root:\n  invert: Open\n  child: {check: $door.data}\n"),
        tree("topics: {door: {topic: door_closed, type: std_msgs/msg/Bool}}\n"
             "root: {check: not $door.data}\n"),
    ),
    _warning("BT315", "a text with the name of a variable",
        "A text names a variable in the way of another language, or consists of names of "
        "variables, and stays a text. Write $name for the value of a variable, $(name) inside of "
        "a text, and '= ' before an expression. Quotes around a bare name mean a text.",
        tree('inputs: {part: string}\nroot: {log: "Part {part}"}\n'),
        tree("inputs: {part: string}\nroot: {log: Part $(part)}\n"),
    ),
    _warning("BT316", "a timer on the wall clock",
        "py_trees' own timer reads the wall clock. The timer goes on while a simulator is paused, "
        "jumps when somebody sets the clock, and never ends in a test in virtual time. 'wait' "
        "reads the clock of the ROS node.",
        tree("root: {python: py_trees.timers.Timer, arguments: {duration: 5.0}}\n"),
        tree("root: {wait: 5 s}\n"),
    ),
    _warning("BT317", "a long duration without a unit",
        "A bare number is seconds. A number from 500 on may be meant as milliseconds, as in other "
        "tools. Write a unit.",
        tree("root: {wait: 500}\n"),
        tree("root: {wait: 500 ms}\n"),
    ),
    _warning("BT318", "a large angle without a unit",
        "Roll, pitch and yaw without a unit are radians, and this angle is more than a full turn. "
        "Write a unit.",
        tree("root:\n  publish: heading\n  type: geometry_msgs/msg/Quaternion\n"
             "  message: {yaw: 90}\n"),
        tree("root:\n  publish: heading\n  type: geometry_msgs/msg/Quaternion\n"
             "  message: {yaw: 90 deg}\n"),
    ),
    _warning("BT319", "a node's name with a variable",
        "The name of a node is constant, and a variable in the name stays text. A 'log' can show "
        "the value.",
        tree("inputs: {part: string}\nroot:\n  sequence: Take $(part)\n"
             "  children: [{check: $part != ''}]\n"),
        tree("inputs: {part: string}\nroot:\n  sequence: Take the part\n"
             "  children: [{log: Take $(part)}]\n"),
    ),
    _warning("BT320", "a branch that fails for the same missing value",
        "An earlier child of a 'fallback' fails while a value is missing, and a later child reads "
        "the same value. So without a message on the topic, or a write to the variable, both "
        "children fail, and the later child does not do its work. Ask with 'known', which never "
        "fails, or put the reading node below a 'force_success'. Where the tree can do nothing "
        "without the value, write '# bt: ignore[BT320]'. The rule leaves some cases out: an "
        "earlier child whose action reads the value in its goal or 'expect', since the action may "
        "fail for other reasons; children after a child that asks with 'known'; a 'log', which "
        "never fails; and a later child with a 'check' of its own, unless the first child is only "
        "a check and no other child is left. A 'wait_until' that a timeout stops counts as a "
        "'check'.",
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
    _warning("BT321", "a comparison with a number that a field never has",
        "The number is outside of the range in the message's comment, so the comparison is always "
        "true, or always false. The charge of a battery is a fraction: 20 % are 0.2. The rule "
        "knows the charge, the parts of a quaternion, latitude and longitude, relative humidity, "
        "and the variances of a pose, a twist or an acceleration, in comparisons of the field "
        "itself with a number. Silence the warning where your driver has a number for an unknown "
        "value, such as -1.",
        tree("topics: {battery: {topic: battery, type: sensor_msgs/msg/BatteryState}}\n"
             "root: {check: $battery.percentage < 20}\n"),
        tree("topics: {battery: {topic: battery, type: sensor_msgs/msg/BatteryState}}\n"
             "root: {check: $battery.percentage < 0.2}\n"),
    ),
    _warning("BT322", "a text in typographic quotes",
        "YAML knows only the quotes ' and \". Quotes of chats and word processors are a part of "
        "the text, and the message would have them. To keep them, put the text in plain quotes.",
        tree("root:\n  publish: note\n  type: std_msgs/msg/String\n  message: {data: “map”}\n"),
        tree('root:\n  publish: note\n  type: std_msgs/msg/String\n  message: {data: "map"}\n'),
    ),
    _warning("BT323", "a condition that never changes",
        "The condition reads no variable, and is always true, or always false. Remove the branch "
        "that the node never ticks.",
        tree("root:\n  if: true\n  then: {success: Go}\n  else: {success: Stay}\n"),
        tree("inputs: {ready: bool}\nroot:\n  if: $ready\n  then: {success: Go}\n"
             "  else: {success: Stay}\n"),
    ),
    _warning("BT324", "a node that has no effect here",
        "An 'every' has an effect only below a 'pipeline' or a 'repeat', which begin its child "
        "again within a visit. A pipeline needs a second child, and 'on_change' needs a goal with "
        "variables.",
        tree("root:\n  sequence: Work\n  children:\n"
             "    - every: 1 s\n      child: {success: Plan}\n    - success: Go\n"),
        tree("root:\n  pipeline: Work\n  children:\n"
             "    - every: 1 s\n      child: {success: Plan}\n    - success: Go\n"),
    ),
)  # fmt: skip
