"""What a simulated server may do wrong on purpose, and to which of its goals. No ROS.

A fault is written ``SERVER:WHEN:FAULT[=VALUE]``: ``move_robot:2:abort`` aborts the second goal that
move_robot is asked for, ``gripper_control:5%:stall`` stalls one goal in twenty,
``/r1/move_robot:*:slow=3`` slows every goal of one robot. KINDS is the one list of faults: parsing,
help and documentation read it.

Times in faults are wall seconds, as the deadlines they are meant to break are; only the motion
follows the simulation's speed.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum

from bt_actions.utilities.suggest import did_you_mean

Value = float | str | None
"""What follows the ``=``: a number, a word, or None where the fault's own default means "half-way"
or "always"."""


class FaultError(ValueError):
    """A fault that is written wrong, or that fits none of the servers; the text says what to do."""


class Unit(StrEnum):
    """What a fault's value is."""

    NONE = ""
    SECONDS = "SECONDS"
    FACTOR = "FACTOR"
    HERTZ = "HERTZ"
    COUNT = "COUNT"
    PHASE = "PHASE"


PHASES = ("accept", "execute", "cancel")
"""When a server dies: before it answers the goal request, half-way, or when asked to cancel."""


class FaultKind(StrEnum):
    """The faults, by the name they are written with."""

    REJECT = "reject"
    DELAY_ACCEPT = "delay_accept"
    DROP_GOAL = "drop_goal"
    DROP_ACCEPT = "drop_accept"
    ABORT = "abort"
    SLOW = "slow"
    STALL = "stall"
    NO_FEEDBACK = "no_feedback"
    FLOOD = "flood"
    REJECT_CANCEL = "reject_cancel"
    IGNORE_CANCEL = "ignore_cancel"
    DROP_CANCEL = "drop_cancel"
    DELAY_CANCEL = "delay_cancel"
    SUCCEED_ON_CANCEL = "succeed_on_cancel"
    ABORT_ON_CANCEL = "abort_on_cancel"
    DELAY_RESULT = "delay_result"
    DROP_RESULT = "drop_result"
    DROP_PART = "drop_part"
    DIE = "die"
    RESTART = "restart"


@dataclass(frozen=True, slots=True)
class Meaning:
    """What a fault does, and what its value is when none is given."""

    does: str
    unit: Unit = Unit.NONE
    default: Value = None


KINDS: Mapping[FaultKind, Meaning] = {
    FaultKind.REJECT: Meaning("refuses the goal"),
    FaultKind.DELAY_ACCEPT: Meaning("answers the goal request late", Unit.SECONDS, 1.0),
    FaultKind.DROP_GOAL: Meaning("loses the goal request: no answer, no motion"),
    FaultKind.DROP_ACCEPT: Meaning("executes the goal, but loses the answer to its request"),
    FaultKind.ABORT: Meaning("aborts half-way, or so long after acceptance", Unit.SECONDS),
    FaultKind.SLOW: Meaning("moves so many times slower", Unit.FACTOR, 5.0),
    FaultKind.STALL: Meaning(
        "half-way, or so long after acceptance, neither moves nor gives feedback until canceled",
        Unit.SECONDS,
    ),
    FaultKind.NO_FEEDBACK: Meaning("moves without giving feedback"),
    FaultKind.FLOOD: Meaning("gives feedback that often", Unit.HERTZ, 1000.0),
    FaultKind.REJECT_CANCEL: Meaning("refuses to cancel"),
    FaultKind.IGNORE_CANCEL: Meaning("agrees to cancel, and goes on to the end"),
    FaultKind.DROP_CANCEL: Meaning("never answers the cancel request, and goes on to the end"),
    FaultKind.DELAY_CANCEL: Meaning(
        "stops when asked to cancel, and is canceled that much later", Unit.SECONDS, 1.0
    ),
    FaultKind.SUCCEED_ON_CANCEL: Meaning("agrees to cancel, and succeeds at once nevertheless"),
    FaultKind.ABORT_ON_CANCEL: Meaning("agrees to cancel, and aborts"),
    FaultKind.DELAY_RESULT: Meaning("sends the result that long after the end", Unit.SECONDS, 1.0),
    FaultKind.DROP_RESULT: Meaning("loses the result, or the first so many answers", Unit.COUNT),
    FaultKind.DROP_PART: Meaning(
        "loses the part half-way, or so long after acceptance", Unit.SECONDS
    ),
    FaultKind.DIE: Meaning(
        f"dies half-way, or when asked to {PHASES[0]} or {PHASES[2]}", Unit.PHASE, "execute"
    ),
    FaultKind.RESTART: Meaning(
        "dies half-way and is back that much later, its goals forgotten", Unit.SECONDS, 1.0
    ),
}

_LISTED = "`bt-actions sim --help` lists the faults"
_SERVER = re.compile(r"\*|/?[A-Za-z_]\w*(/[A-Za-z_]\w*)*", re.ASCII)
_NUMBER = re.compile(r"[0-9]{1,9}", re.ASCII)
_PERCENT = re.compile(r"([0-9]+\.?[0-9]*|\.[0-9]+)%", re.ASCII)


@dataclass(frozen=True, slots=True)
class Fault:
    """One fault: of which server, on which of its goals, and what it does."""

    server: str
    """A name without namespace fits that server in every namespace; ``*`` fits every server."""
    kind: FaultKind
    value: Value = None
    """None stands for the fault's default."""
    number: int | None = None
    """The goal it strikes, counted from 1 for each server; None for any."""
    probability: float = 1.0

    def __post_init__(self) -> None:
        if self.number is not None and self.number < 1:
            raise FaultError(f"goals are counted from 1, not {self.number}")
        if not 0.0 < self.probability <= 1.0:
            raise FaultError(f"a probability lies between 0 and 1, not {self.probability}")
        meaning = KINDS[self.kind]
        given = meaning.default if self.value is None else self.value
        object.__setattr__(self, "value", _checked(str(self.kind), meaning.unit, given))

    @classmethod
    def parse(cls, text: str) -> Fault:
        """Read ``SERVER:WHEN:FAULT[=VALUE]``; raise FaultError, which says what is wrong with it.

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
        shown = f"={value}" if self.value != KINDS[self.kind].default else ""
        return f"{self.server}:{when}:{self.kind}{shown}"

    def fits(self, server: str) -> bool:
        """Say whether this fault belongs to `server`, a fully qualified action name."""
        if self.server == "*":
            return True
        if "/" in self.server:
            return server == self.server
        return server.rpartition("/")[2] == self.server


def table() -> str:
    """Return all faults, one a line, with what they do and their defaults."""
    rows = []
    for kind, meaning in KINDS.items():
        default = meaning.default
        shown = f" ({default:g})" if isinstance(default, float) else ""
        rows.append(f"  {_signature(kind):24}{meaning.does}{shown}")
    return "\n".join(rows)


def _signature(kind: FaultKind) -> str:
    unit = KINDS[kind].unit
    return f"{kind}[={unit}]" if unit else str(kind)


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
        close = did_you_mean(name, map(str, KINDS)) or f"; {_LISTED}"
        raise FaultError(f"{text!r}: there is no fault {name!r}{close}") from None


_LEAST = {Unit.SECONDS: 0.0, Unit.FACTOR: 1.0, Unit.HERTZ: 1.0, Unit.COUNT: 1.0}
_MOST = 1e6


def _read_value(kind: FaultKind, given: str) -> Value:
    unit = KINDS[kind].unit
    if unit in {Unit.NONE, Unit.PHASE}:
        return given
    number = given.removesuffix("s").strip() if unit is Unit.SECONDS else given
    try:
        return float(number)
    except ValueError:
        raise FaultError(f"{kind} takes {unit}, a number, not {given!r}") from None


def _checked(kind: str, unit: Unit, value: Value) -> Value:
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
