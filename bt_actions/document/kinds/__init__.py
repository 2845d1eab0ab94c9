"""The kinds of nodes, a file each (or a few that differ by a word). Their import fills `KINDS`.

A file says how its kind is read, checked and built; `language/kinds.py` says what a kind is. A
kind's build imports the behaviour when a node is built: reading and checking need none.
"""

from bt_actions.document.kinds.composites import if_, in_turn, parallel, pipeline
from bt_actions.document.kinds.decorators import (
    every,
    for_each,
    forced,
    invert,
    repeat,
    retry,
    run_once,
    timeout,
    while_,
)
from bt_actions.document.kinds.leaves import (
    action,
    check,
    fixed,
    log,
    publish,
    python,
    run_tree,
    service,
    set_,
    subtree,
    wait,
    wait_for_message,
    wait_until,
)
from bt_actions.document.kinds.own import OWN
from bt_actions.document.language.kinds import KINDS, OWN_KINDS, register

__all__ = ["KINDS"]

register(
    *in_turn.KINDS,
    *(each.KIND for each in (parallel, if_, pipeline, retry, repeat, every, timeout, invert)),
    *forced.KINDS,
    *(each.KIND for each in (run_once, for_each, while_)),
    *(each.KIND for each in (action, run_tree, service, publish, wait_for_message, wait)),
    *(each.KIND for each in (wait_until, set_, log, python, check, subtree)),
    *fixed.KINDS,
)
OWN_KINDS.update(OWN)
