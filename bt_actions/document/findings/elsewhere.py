"""Words and notations of other tools, and what to write here instead.

A report of a mistake asks this file before it asks for similar spellings: `Switch` is no 'wait'.
"""

from __future__ import annotations

import re
from collections.abc import Container
from collections.abc import Mapping as MappingType

from bt_actions.utilities.suggest import folded


def _table(rows: MappingType[str, str]) -> dict[str, str]:
    """Turn a table round: from each foreign word to the words here."""
    return {word: here for here, words in rows.items() for word in words.split()}


_OFTEN = "children that succeeded are not run again within a visit"
_KINDS = _table(
    {
        "here it is 'sequence'": "serial series steps block asyncsequence",
        "here it is 'sequence' with 'memory: resume'": "sequencewithmemory sequencestar",
        f"here it is 'sequence': {_OFTEN}": "memsequence",
        "here it is 'sequence' with 'memory: false'": "reactivesequence",
        "here it is 'fallback'": "selector asyncfallback fallbackstar selectorwithmemory try",
        "here it is 'fallback' with 'memory: false'": "reactivefallback reactiveselector",
        "here it is 'parallel'": "parallelall parallelnode concurrent all join gather",
        "here it is 'while'": "eternalguard",
        "here it is 'if'": "ifthenelse whiledoelse",
        "it is a key of 'if'": "then else",
        "here it is 'invert'": "inverter not negate",
        "here it is 'retry'": "retryuntilsuccessful retryuntilsuccesful failureisrunning",
        "here it is 'repeat'": "keeprunninguntilfailure successisrunning",
        "here it is 'repeat', 'while' or 'for_each'": "loop",
        "here it is 'for_each'": "for each",
        "here it is 'force_success'": "succeeder failureissuccess",
        "here it is 'force_failure'": "failer successisfailure",
        "here it is 'success'": "alwayssuccess succeed",
        "here it is 'failure'": "alwaysfailure fail",
        "here it is 'run_once'": "oneshot once singletrigger",
        "here it is 'wait'": "delay sleep timer pause",
        "here it is 'wait_until'": "waitfor waitforblackboardvariable "
        "waitforblackboardvariablevalue",
        "here it is 'wait_for_message'": "subscribe subscriber topic waitfortopic",
        "here it is 'publish'": "publisher topicpublisher",
        "here it is 'subtree'": "include tree calltree subtreeplus",
        "here it is 'set'": "script setblackboard setblackboardvariable setvariable assign",
        "here it is 'check'": "scriptcondition precondition condition ifcondition guard assert "
        "checkblackboardvariablevalue",
        "here it is 'log'": "print echo say debug",
        "here it is 'service'": "callservice servicecall serviceclient call",
        "here it is 'action'": "sendgoal actionclient",
        "write an 'if', and another one as its else": "switch case match",
        "here it is 'every', in a 'pipeline' or a 'repeat'": "ratecontroller rate throttle "
        "periodic",
        "here it is 'retry', with a recover beside its child": "recover recovery recoverynode",
        "write a 'fallback' with in_turn: true": "roundrobin",
        "here it is 'pipeline'": "pipelinesequence",
    }
)  # fmt: skip
"""Kinds of nodes under their foreign names, in small letters and without underscores."""
_FIELDS = ("goal", "request", "message", "with", "arguments", "inputs")
_AGAIN = "retry: {attempts: 3, backoff: 2 s}"
_KEYS: dict[str, tuple[str, ...]] = {
    word: here
    for words, here in {
        "name id": ("tree", "topic", "server"),
        "params parameters args fields": _FIELDS,
        "input inputs": ("with", *_FIELDS),
        "vars variables arg": ("inputs", "with"),
        "output outputs register": ("save",),
        "retries restart numattempts maxattempts maxretries tries": ("attempts", "retry"),
        "numcycles cycles count": ("times", "attempts"),
        "delay delayms pause": ("after", "backoff", _AGAIN),
        "msec seconds duration timeoutms": ("after", "timeout"),
        "until successcondition condition": ("expect", "when", "until"),
        "when if precondition": ("only_if",),
        "unless": ("only_if: not ...",),
        "threshold successthreshold successcount": ("policy",),
        "actionname servername servicename remap remappings": ("server",),
        "topicname": ("topic",),
        "interface actiontype servicetype topictype messagetype msgtype": ("type",),
        "msg data": ("message", "request", "goal"),
    }.items()
    for word in words.split()
}
"""Keys under their foreign names, with the keys here: the first that can stand in the place."""
_INSTEAD: dict[str, tuple[str, str]] = {
    word: (beside, here)
    for words, beside, here in (
        ("loop withitems", "", "put the node into a 'for_each'"),
        ("skipif", "", "write 'only_if: not ...'"),
        ("elif elseif", "then", "write 'else', and another 'if' there"),
        ("failsafter atleast", "policy", "write it below 'policy'"),
        ("onsuccess post", "", "put a 'set' behind the node, in a 'sequence'"),
        ("dependson requires", "", "the children of a 'sequence' run one after the other"),
        ("environment env envfile", "",
         "a tree starts no programs: set their environment where they start"),
        ("launch", "actions", "a tree starts no programs: that is for ROS launch"),
        ("version apiversion btcppformat", "actions", "a tree has no version: leave it away"),
        ("pkg package", "type", "the package is a part of the type, as in std_msgs/msg/Bool"),
        ("min max minimum maximum range", "default",
         "an input has no limits: begin the tree with a 'check'"),
    )
    for word in words.split()
}  # fmt: skip
"""The remedy for a foreign key that has no equal here, where another key could stand
beside it.
"""
_TYPES = _table(
    {
        "write float64": "double real",
        "write float32 or float64": "float number",
        "write int32 or int64": "int integer",
        "write bool": "boolean",
        "write string": "str text",
        "write float64 for seconds": "duration time",
        "a list is written float64[], string[], ...": "list array vector tuple sequence",
        "a mapping is written as a message's type: package/msg/Name": "dict map object mapping any",
    }
)
"""Types under their foreign names."""
_REACH = 300
"""Characters of a text that are looked at."""
_ASSIGNED = re.compile(r"\$?([A-Za-z]\w*)\s*:?=\s*([^\s=][^=]*)", re.ASCII)
_PACKAGE = re.compile(r"\$\(find(?:-pkg-share)? +([\w-]+)\)/*(\S+)", re.ASCII)
_NOTATION = re.compile(
    r"""(?P<environment> \$\{ \w+ :?[-=?+] [^{}]* \} | \$\( (?:opt)?env \s [^()]* \) )
    | (?P<launch> \$\( (?:find|find-pkg-\w+|eval|command) \b [^()]* \) )
    | \$\( (?:var|arg) \s+ (?P<arg>[A-Za-z_][\w.]*) \s* \)
    | (?:\$\{|\{\{?\ *@?) \ * (?P<name>[A-Za-z_][\w.]*) \ * \}\}?""",
    re.VERBOSE | re.ASCII,
)


def kind_here(word: str) -> str | None:
    """Say what to write for a foreign kind of node: ``here it is 'fallback'``."""
    wanted = folded(word)
    return _KINDS.get(wanted) or _KINDS.get(wanted.rstrip("0123456789"))  # BehaviorTree's Switch2


def key_here(word: str, known: Container[str]) -> tuple[str | None, str | None]:
    """Say what to write for a key where `known` can stand: another key, or something else to do."""
    wanted = folded(word)
    for key in _KEYS.get(wanted, ()):
        if key.partition(":")[0] in known:
            return key, None
    beside, instead = _INSTEAD.get(wanted, ("", ""))
    return None, instead if not beside or beside in known else None


def type_here(text: str) -> str | None:
    """Say what to write for a foreign type: ``write float64``."""
    word = re.match("[A-Za-z]+", text)
    return _TYPES.get(folded(word[0])) if word is not None and "/" not in text else None


def notation_here(text: str, at: int | None = None, *, computes: bool = False) -> str | None:
    """Say what to write for a variable in a foreign notation: ``{x}``, ``${x}``, ``{{ x }}``.

    Looks at the place `at`, or for the first notation. `computes` says that the text is an
    expression, in which a variable is never `$(x)`.
    """
    find = _NOTATION.search if at is None else _NOTATION.match
    found = find(text, at or 0, (at or 0) + _REACH)
    if found is None:
        return None
    if found["environment"]:
        return "the environment is not read: write the value, or '$name' for an input"
    if found["launch"]:
        return "what ROS launch puts in is not read: write the value, or '$name' for an input"
    name = found["name"] or found["arg"]
    rest = ", and the environment is not read" if name.isupper() else ""
    if computes or found[0] == text.strip():
        return f"a variable is written ${name}{rest}"
    return f"inside a text a variable is written $({name}){rest}"


def package_here(text: str) -> str | None:
    """Say what to write for a tree's file in ROS launch's notation of a package."""
    found = _PACKAGE.match(text[:_REACH])
    return None if found is None else f"write package://{found[1]}/{found[2]}"


def as_mapping(text: str, root: str | None = None) -> str | None:
    """Say what to write for a mapping in the form ``a=1, b=2``.

    With `root`, a name by itself means a part of it: `x` means `{x: result.x}`.
    """
    if text.startswith("{") and ":" in text and text.endswith("}"):
        return "without its quotes it is a mapping"
    pairs = [_pair(part.strip(), root) for part in text[:_REACH].split(",")]
    told = [pair for pair in pairs if pair is not None]
    return f"write {{{', '.join(told)}}}" if told == pairs and len(text) <= _REACH else None


def _pair(part: str, root: str | None) -> str | None:
    found = _ASSIGNED.fullmatch(part)
    if found is not None:
        name, value = found.groups()
        computes = "$" in value and re.fullmatch(r"\$[\w.]+", value) is None
        return f"{name}: {'= ' if computes and root is None else ''}{value}"
    name = part.rpartition(".")[2]
    if root is None or re.fullmatch("[A-Za-z][A-Za-z0-9_.]*", part) is None or not name:
        return None
    return f"{name}: {part if '.' in part or not root else f'{root}.{part}'}"
