"""The page folds events as `story/state.py` does, reached step by step or by a leap."""

from __future__ import annotations

import json
import random
from typing import Any

import pytest
from py_trees.common import Status

from bt_actions.events import (
    AttemptEnded,
    Event,
    GoalChanged,
    Moment,
    Node,
    NodeChanged,
    NodesAdded,
    NodesRemoved,
    RunBegan,
    StopWanted,
    TickLasts,
    TreeFinished,
)
from bt_actions.events.wire import to_plain
from bt_actions.goals.policy import End, Outcome
from bt_actions.page.feed import known
from bt_actions.story.failures import Failure
from bt_actions.story.state import State
from tests.page.conftest import Served
from tests.page.test_panes import Story
from tests.support import browser as chromium
from tests.support.every_kind import RUN_ID, every_kind

pytestmark = pytest.mark.skipif(bool(chromium.missing()), reason=chromium.missing() or "-")

TELL = """
const state = window.Fold, run = new window.Store.Run("x"), events = JSON.parse(arguments[0]), counts = arguments[1];
run.take({ from: 1, to: events.at(-1).at[0], events });
const LOOK = { running: "RUNNING", success: "SUCCESS", failure: "FAILURE", stopped: "INVALID", idle: "INVALID" };
const number = (n) => run.nodes[n].number;
const told = (one) => [number(one.n), one.number, one.message, one.by === null ? null : number(one.by)];
return counts.map((count) => {
  const s = run.go(count);
  return {
    begun: run.order.filter((node) => state.is_begun(s, node.id, run.nodes)).map((node) => node.number).sort((a, b) => a - b),
    status: run.nodes.map((node) => [node.number, LOOK[s.status[node.id]]]),
    pending: [...s.pending].map(([n, all]) => [number(n), all.map(told)]).sort((a, b) => a[0] - b[0]),
    dealt: s.dealt.map(told), in_all: s.dealt_in_all,
    stop: s.stop?.who ?? null, stopped: s.stopped.map((one) => number(one.n)).sort((a, b) => a - b),
    lasting: s.lasting ? number(s.lasting.n) : null, paused: s.paused, finished: s.finished?.status ?? null,
  };
});
"""  # noqa: E501
"""What the page's store says behind so many events, for each of some counts."""


def told(events: list[Event], count: int) -> dict[str, Any]:
    """The same by the fold of Python."""
    state, nodes = State(), dict[int, None]()
    for number, event in enumerate(events):
        if number < count:
            state.fold(event)
        if isinstance(event, RunBegan | NodesAdded):
            nodes |= dict.fromkeys(node.id for node in event.nodes)

    def failure(one: Failure) -> list[Any]:
        by = one.by.id if one.by is not None else None
        return [one.node.id, one.at.number, one.message, by]

    last = State()
    for event in events:
        last.fold(event)
    return {
        "begun": sorted(
            node for node in last.nodes if node in state.nodes and state.is_begun(node)
        ),
        "status": [[node, state.status_of(node).value] for node in nodes],
        "pending": [
            [node, [failure(one) for one in state.nodes[node].pending]]
            for node in sorted(state.nodes)
            if state.nodes[node].pending
        ],
        "dealt": [failure(one) for one in state.dealt_with],
        "in_all": state.dealt_with_in_all,
        "stop": state.stop.who if state.stop is not None else None,
        "stopped": sorted(one.node.id for one in state.stopped),
        "lasting": state.lasting.node if state.lasting is not None else None,
        "paused": state.paused,
        "finished": state.finished.status.value if state.finished is not None else None,
    }


def any_run(seed: int, length: int = 1200) -> list[Event]:
    """Any events at all: also those that no tree would make."""
    dice = random.Random(seed)
    kinds = ["sequence", "fallback", "invert", "retry", "action"]
    nodes = [Node(1, None, "Root", "sequence")]
    for number in range(2, 20):
        parent = dice.randrange(1, number)
        nodes.append(Node(number, parent, f"Node {number}", dice.choice(kinds), server="/a"))
    events: list[Event] = []

    def tell(kind: Any, *fields: Any, **more: Any) -> None:
        number = len(events) + 1
        at = Moment(number, 100.0 + number / 8, 1.8e9 + number / 8, number / 4)
        events.append(kind(at, *fields, **more))

    tell(RunBegan, RUN_ID, "any", tuple(nodes), {"x": 1}, {}, {})
    there = [node.id for node in nodes]
    for step in range(length):
        node, fate = dice.choice(there), dice.random()
        if fate < 0.9:
            status = dice.choice([*Status, Status.FAILURE, Status.FAILURE])
            tell(NodeChanged, node, status, f"step {step}", by_itself=dice.random() < 0.2)
        elif fate < 0.94:
            goal = f"{node:032x}"
            tell(GoalChanged, node, goal, 1, "EXECUTING", None, None, "", "/a")
            ended = "DONE", Outcome.ABORTED, End.ABORTED, "so", "/a"
            tell(GoalChanged, node, goal, 1, *ended)
            tell(AttemptEnded, node, goal, 1, Outcome.ABORTED, "so")
        elif fate < 0.96:
            tell(TickLasts, node, 1.0, dice.random() < 0.5)
        elif fate < 0.98:
            number = max(node.id for node in nodes) + 1
            nodes.append(Node(number, node, f"New {number}", "wait", index=0))
            there.append(number)
            tell(NodesAdded, (nodes[-1],))
        elif len(there) > 5:
            leaf = max(there)  # which has no children
            there.remove(leaf)
            tell(NodesRemoved, (leaf,))
        if step == length // 2:
            tell(StopWanted, "SIGINT", "stopped")
    tell(TreeFinished, Status.FAILURE)
    return events


@pytest.mark.parametrize("way", ["forwards", "by leaps"])
@pytest.mark.parametrize("seed", range(5))
def test_the_state_is_the_same_behind_every_event(
    served: Served, window: chromium.Browser, seed: int, way: str
) -> None:
    events = any_run(seed) if seed else every_kind(rounds=60)
    counts = random.Random(seed).sample(range(2, len(events) + 1), 200)
    if way == "forwards":
        counts.sort()
    said = in_page(served, window, [to_plain(each) for each in events], counts)
    for count, one in zip(counts, said, strict=True):
        expected = told(events, count)
        mine = dict(one["status"])
        assert {node: status for node, status in expected["status"] if mine[node] != status} == {}
        del one["status"], expected["status"]
        assert one == expected, f"behind {count} events"


@pytest.mark.parametrize("seed", range(1, 4))
def test_the_state_is_the_same_where_events_are_missing(
    served: Served, window: chromium.Browser, seed: int
) -> None:
    events = any_run(seed)
    state = State()
    for event in events[:700]:
        state.fold(event)
    rest = [to_plain(each) for each in events[700:]]
    plain = [*(to_plain(each) for each in events[:100]), known(state), *rest]
    counts = [101, *range(105, len(plain), 50), len(plain)]
    for count, one in zip(counts, in_page(served, window, plain, counts), strict=True):
        expected = told(events, count + 599)
        mine = dict(one["status"])
        left = {node: status for node, status in expected["status"] if node in mine}
        assert {node: mine[node] for node in left} == left
        for name in ("begun", "pending", "stop", "lasting", "finished"):
            assert one[name] == expected[name], f"{name} behind {count} events"
        # Of a node that came and went while nothing was recorded the page knows nothing.
        dealt = [each for each in expected["dealt"] if each[0] in mine]
        assert dealt
        assert [each[:3] for each in one["dealt"]][-len(dealt) :] == [each[:3] for each in dealt]


STORIES = """
const run = new window.Store.Run("x"), events = JSON.parse(arguments[0]);
run.take({ from: 1, to: events.at(-1).at[0], events });
return import("/words.js").then(({ story }) => run.attempts.map((a) => story(a, run.nodes[a.n], run.clock)));
"""  # noqa: E501


def test_of_an_attempt_whose_end_is_not_recorded_that_is_said(
    served: Served, window: chromium.Browser
) -> None:
    story, state = Story(), State()
    story.begin(1.0, "1" * 32)
    plain = [to_plain(each) for each in story.told]
    story.end(2.0, "1" * 32)
    story.begin(3.0, "2" * 32)
    for each in story.told:
        state.fold(each)
    in_page(served, window, [*plain, known(state)], [0])
    first, second = window.run(STORIES, json.dumps([*plain, known(state)]))
    assert first.endswith(". How it ended is not recorded.")
    assert "executing" in second


def test_a_batch_that_does_not_follow_is_refused_and_one_that_overlaps_is_taken_once(
    served: Served, window: chromium.Browser
) -> None:
    events = [to_plain(each) for each in every_kind()]
    in_page(served, window, events, [0])
    batch = (
        "const run = new window.Store.Run('x'), events = JSON.parse(arguments[0]);"
        "const take = (from, to) => run.take({ from, to, events: events.slice(from - 1, to) });"
        "return [take(1, 8), take(10, 12), take(5, 9), take(10, 12), run.events.length];"
    )
    assert window.run(batch, json.dumps(events)) == [True, False, True, True, 12]


def in_page(
    served: Served, window: chromium.Browser, events: list[dict[str, Any]], counts: list[int]
) -> list[Any]:
    window.open(f"http://127.0.0.1:{served.port}/")
    window.run("import('/state.js').then((found) => { window.Fold = found; })")
    window.run("import('/store.js').then((found) => { window.Store = found; })")
    assert window.wait_for("window.Store !== undefined && window.Fold !== undefined")
    found = window.run(TELL, json.dumps(events), counts)
    assert isinstance(found, list)
    return found


CUT = """
const [text, cuts] = arguments, all = () => JSON.parse(text), last = all().at(-1).at[0];
const state = (run, count) => { const { leaves_at, ...s } = run.go(count); return JSON.stringify({ ...s, status: [...s.status], pending: [...s.pending], due: [...s.due], round: [...s.round], backoff: [...s.backoff], vars: [...s.vars], running: [...s.running] }); };
const whole = new window.Store.Run("x");
whole.take({ from: 1, to: last, events: all() });
return cuts.filter((cut) => {
  const run = new window.Store.Run("x"), events = all(), again = Math.max(0, cut - 3);
  run.take({ from: 1, to: events[cut].at[0], events: events.slice(0, cut + 1) });
  run.go(cut);
  run.take({ from: events[again].at[0], to: last, events: all().slice(again) });
  return state(run, events.length) !== state(whole, events.length) || state(run, cut) !== state(whole, cut);
});
"""  # noqa: E501
"""Those cuts after which a stream that is resumed, with some events twice, gives another state."""


def test_a_stream_that_is_cut_and_resumed_gives_the_same_state(
    served: Served, window: chromium.Browser
) -> None:
    events = [to_plain(each) for each in any_run(7, 400)]
    in_page(served, window, events, [0])
    cuts = [at for at in range(1, len(events) - 1) if events[at]["kind"] != "EventsLost"][::9]
    assert window.run(CUT, json.dumps(events), cuts) == []
