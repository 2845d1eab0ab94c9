"""The faults of a simulated server on purpose, and the goals that they strike. No ROS.

A fault is written ``SERVER:WHEN:FAULT[=VALUE]``: ``move_robot:2:abort`` aborts the second goal that
move_robot is asked for, ``gripper_control:5%:stall`` stalls one goal in twenty,
``/r1/move_robot:*:slow=3`` slows every goal of one robot. FaultKind is the one list of faults:
parsing, help and documentation read it.

Times in faults are wall seconds, as the deadlines that they are to break are; only the motion
follows the simulation's speed.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from enum import StrEnum
from typing import Self

from bt_actions.utilities.suggest import did_you_mean

Value = float | str | None
"""The text after the ``=``: a number, a word, or None where the fault's own default means
"half-way" or "always"."""


class FaultError(ValueError):
    """A fault that is written wrong, or fits none of the servers; the text has the remedy."""


class Unit(StrEnum):
    """The unit of a fault's value."""

    NONE = ""
    SECONDS = "SECONDS"
    FACTOR = "FACTOR"
    HERTZ = "HERTZ"
    COUNT = "COUNT"
    PHASE = "PHASE"


PHASES = ("accept", "execute", "cancel")
"""The phases in which a server dies: before it answers the goal request, half-way, or when asked
to cancel."""


class FaultKind(StrEnum):
    """The faults, by the name they are written with."""

    def __new__(
        cls, name: str, does: str = "", unit: Unit = Unit.NONE, default: Value = None
    ) -> Self:
        """Make a member with the words for its effect, and its default value."""
        kind = str.__new__(cls, name)
        kind._value_ = name
        kind.does, kind.unit, kind.default = does, unit, default
        return kind

    does: str
    unit: Unit
    default: Value

    REJECT = "reject", "refuses the goal"
    DELAY_ACCEPT = "delay_accept", "answers the goal request late", Unit.SECONDS, 1.0
    DROP_GOAL = "drop_goal", "loses the goal request: no answer, no motion"
    DROP_ACCEPT = "drop_accept", "executes the goal, but loses the answer to its request"
    ABORT = "abort", "aborts half-way, or so long after acceptance", Unit.SECONDS
    SLOW = "slow", "moves so many times slower", Unit.FACTOR, 5.0
    STALL = (
        "stall",
        "half-way, or so long after acceptance, neither moves nor gives feedback until canceled",
        Unit.SECONDS,
    )
    NO_FEEDBACK = "no_feedback", "moves without giving feedback"
    FLOOD = "flood", "gives feedback that often", Unit.HERTZ, 1000.0
    REJECT_CANCEL = "reject_cancel", "refuses to cancel"
    IGNORE_CANCEL = "ignore_cancel", "agrees to cancel, and goes on to the end"
    DROP_CANCEL = "drop_cancel", "never answers the cancel request, and goes on to the end"
    DELAY_CANCEL = (
        "delay_cancel",
        "stops when asked to cancel, and is canceled that much later",
        Unit.SECONDS,
        1.0,
    )
    SUCCEED_ON_CANCEL = "succeed_on_cancel", "agrees to cancel, and succeeds at once nevertheless"
    ABORT_ON_CANCEL = "abort_on_cancel", "agrees to cancel, and aborts"
    DELAY_RESULT = "delay_result", "sends the result that long after the end", Unit.SECONDS, 1.0
    DROP_RESULT = "drop_result", "loses the result, or the first so many answers", Unit.COUNT
    DROP_PART = "drop_part", "loses the part half-way, or so long after acceptance", Unit.SECONDS
    DIE = "die", "dies half-way, or when asked to accept or cancel", Unit.PHASE, "execute"
    RESTART = (
        "restart",
        "dies half-way and is back that much later, its goals forgotten",
        Unit.SECONDS,
        1.0,
    )


_LISTED = "`bt-actions sim --help` lists the faults"
_SERVER = re.compile(r"\*|/?[A-Za-z_]\w*(/[A-Za-z_]\w*)*", re.ASCII)
_NUMBER = re.compile(r"[0-9]{1,9}", re.ASCII)
_PERCENT = re.compile(r"([0-9]+\.?[0-9]*|\.[0-9]+)%", re.ASCII)


@dataclass(frozen=True, slots=True)
class Fault:
    """One fault: its server, its goals, and its effect."""

    server: str
    """A name without namespace fits that server in every namespace; ``*`` fits every server."""
    kind: FaultKind
    value: Value = None
    """None stands for the fault's default."""
    number: int | None = None
    """The number of the goal that it strikes, from 1 for each server; None for any."""
    probability: float = 1.0

    def __post_init__(self) -> None:
        if self.number is not None and self.number < 1:
            raise FaultError(f"goals are counted from 1, not {self.number}")
        if not 0.0 < self.probability <= 1.0:
            raise FaultError(f"a probability lies between 0 and 1, not {self.probability}")
        given = self.kind.default if self.value is None else self.value
        object.__setattr__(self, "value", _checked(self.kind, given))

    @classmethod
    def parse(cls, text: str) -> Fault:
        """Read ``SERVER:WHEN:FAULT[=VALUE]``; raise FaultError, with the reason.

        WHEN is the number of a goal, ``*`` for every goal, or a percentage like ``5%``.
        """
        parts = text.split(":")
        if len(parts) != 3:
            raise FaultError(
                f"{text!r} is not a fault: it is written SERVER:WHEN:FAULT[=VALUE], "
                f"as in move_robot:2:abort; {_LISTED}"
            )
        server, when, what = (part.strip() for part in parts)
        if not _SERVER.fullmatch(server):
            raise FaultError(
                f"{text!r}: {server!r} is not the name of a server; "
                "give it as move_robot, /r1/move_robot, or * for every server"
            )
        number, probability = _when(text, when)
        name, equals, value = what.partition("=")
        kind = _kind(text, name.strip())
        try:
            return cls(
                server="/" + server.lstrip("/") if "/" in server else server,
                kind=kind,
                value=_read_value(kind, value.strip()) if equals else None,
                number=number,
                probability=probability,
            )
        except FaultError as error:
            raise FaultError(f"{text!r}: {error}") from None

    def __str__(self) -> str:
        when = "*" if self.number is None else str(self.number)
        if self.probability < 1.0:
            when = f"{self.probability * 100:g}%"
        value = f"{self.value:g}" if isinstance(self.value, float) else self.value
        shown = f"={value}" if self.value != self.kind.default else ""
        return f"{self.server}:{when}:{self.kind}{shown}"

    def fits(self, server: str) -> bool:
        """Return whether this fault belongs to `server`, a fully qualified action name."""
        if self.server == "*":
            return True
        if "/" in self.server:
            return server == self.server
        return server.rpartition("/")[2] == self.server


def table() -> str:
    """Return all faults, one a line, with their effects and defaults."""
    rows = []
    for kind in FaultKind:
        shown = f" ({kind.default:g})" if isinstance(kind.default, float) else ""
        rows.append(f"  {_signature(kind):24}{kind.does}{shown}")
    return "\n".join(rows)


def _signature(kind: FaultKind) -> str:
    return f"{kind}[={kind.unit}]" if kind.unit else str(kind)


def _when(text: str, when: str) -> tuple[int | None, float]:
    if when == "*":
        return None, 1.0
    if _NUMBER.fullmatch(when) and int(when) >= 1:
        return int(when), 1.0
    if (percent := _PERCENT.fullmatch(when)) and 0.0 < float(percent[1]) <= 100.0:
        return None, float(percent[1]) / 100.0
    raise FaultError(
        f"{text!r}: {when!r} does not say which goal; "
        "give its number (2), * for every goal, or a percentage between 0 and 100 (5%)"
    )


def _kind(text: str, name: str) -> FaultKind:
    try:
        return FaultKind(name.replace("-", "_").lower())
    except ValueError:
        close = did_you_mean(name, map(str, FaultKind)) or f"; {_LISTED}"
        raise FaultError(f"{text!r}: there is no fault {name!r}{close}") from None


_LEAST = {Unit.SECONDS: 0.0, Unit.FACTOR: 1.0, Unit.HERTZ: 1.0, Unit.COUNT: 1.0}
_MOST = 1e6


def _read_value(kind: FaultKind, given: str) -> Value:
    if kind.unit in {Unit.NONE, Unit.PHASE}:
        return given
    number = given.removesuffix("s").strip() if kind.unit is Unit.SECONDS else given
    try:
        return float(number)
    except ValueError:
        raise FaultError(f"{kind} takes {kind.unit}, a number, not {given!r}") from None


def _checked(kind: FaultKind, value: Value) -> Value:
    unit = kind.unit
    if value is None:
        return None
    if unit is Unit.NONE:
        raise FaultError(f"{kind} takes no value")
    if unit is Unit.PHASE:
        if value not in PHASES:
            close = did_you_mean(str(value), PHASES)
            raise FaultError(f"{kind} takes one of {', '.join(PHASES)}, not {value!r}{close}")
        return value
    number = float(value)
    in_range = _LEAST[unit] <= number <= _MOST
    if not in_range or (unit is Unit.COUNT and number != math.floor(number)):
        whole = "a whole number" if unit is Unit.COUNT else "a number"
        raise FaultError(
            f"{kind} takes {unit}, {whole} from {_LEAST[unit]:g} to {_MOST:.0f}, not {number:g}"
        )
    return number
