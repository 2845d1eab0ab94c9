"""Virtual time passes from one thing to the next, in an order that is said."""

from bt_actions.testing.timeline import Timeline


def test_what_is_due_at_one_moment_happens_in_the_order_in_which_it_was_said() -> None:
    timeline, happened = Timeline(), list[str]()
    for name, when in (("late", 2.0), ("first", 1.0), ("second", 1.0), ("off", 1.5)):
        alarm = timeline.call_at(when, lambda name=name: happened.append(name))
        if name == "off":
            alarm.cancel()
    while timeline.advance(3.0):
        happened.append(f"{timeline.now:g}")
    assert happened == ["first", "1", "second", "1", "late", "2"]
    assert timeline.now == 3.0
