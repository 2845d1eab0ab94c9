"""What the scenarios tell the report: docs/reliability.md is written from it and from nothing else.

A row is kept for each scenario that ran. Times are rounded so that two runs read alike.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import groupby
from pathlib import Path
from typing import Any

from bt_actions.goals.attempts import AttemptRecord
from bt_actions.simulation import journal
from tests.support.processes import Journal

HEAD = """\
# Reliability: what was tried, and what became of the goals

<!-- Written by `make chaos` from its last run; do not edit. -->

**What was tried.** Each scenario sends goals over the real middleware. Meanwhile servers die, stop,
restart, come late or run twice, answers are lost or doubled, trees change their mind, programs end,
and networks are cut. The processes, signals and network cuts are real; a row says so where a
scenario only imitates a fault.
"""
READING = """\
**How to read a row.** Each server writes a journal, with a line for each goal that it receives,
accepts, cancels or finishes. The journal decides whether the scenario held ("–": no server took
part). The column outcome shows what the client reported, and also the end of the goal where the end
differs. The time is the rounded time from the fault to the outcome, where the scenario measured it.
The brackets after a name hold the parameters of the row.

[promises.md](promises.md#what-cannot-be-known-from-outside) has the promises that no client can
keep, and [reliability-settings.md](reliability-settings.md) the short lease for servers of your
own. All processes use UDP (on loopback, or on the link between two network namespaces), except the
servers "with Fast DDS as it comes".

To repeat a row, use the words of its name: `python -m pytest tests/scenarios -m "" -k
killed_with_the_short_lease`. By hand: `bt-actions sim --fault move_robot:1:die` in one terminal,
`bt-actions run` in another.
"""
ON_A_BUSY_MACHINE = 3.0
"""Times longer than a scenario's limit is good enough where no report is written: `make test` runs
beside anything, and a lease of 20 s, or a deadline that is forgotten, still stands out."""
SHOWN = 4
"""Goals (alike ones in a row are one) whose events are told one by one; more are counted."""


@dataclass
class Record:
    """One scenario, as it fills itself in; what it leaves out, its journals and leaves tell."""

    family: str
    scenario: str
    number: int = 0
    """Its place in the report."""
    did: str = ""
    outcome: str = ""
    seconds: float | None = None
    limit: float | None = None
    leniency: float = 1.0
    shows: str = ""
    verdict: str = "failed"
    journals: list[Journal] = field(default_factory=list)
    visits: list[list[AttemptRecord]] = field(default_factory=list)
    """The attempts of each visit to a leaf of the scenario's own process."""

    def took(self, seconds: float, limit: float | None = None) -> None:
        """Note the time to the outcome; with `limit`, fail the scenario when it took longer."""
        self.seconds, self.limit = seconds, limit
        if limit is not None:
            allowed = limit * self.leniency
            assert seconds <= allowed, f"took {seconds:.2f} s, allowed are {allowed:g} s"

    def read(self) -> None:
        """Say what the journals show and how the visits ended, unless the scenario has said it."""
        self.outcome = self.outcome or stood(self.visits)
        if not self.shows:
            told = [(each, summary([each])) for each in self.journals]
            many = len(told) > 1
            self.shows = "; ".join(
                f"{last_part(each.server)}: {text}" if many else text for each, text in told
            )
            if len(told) > SHOWN:
                self.shows = summary(self.journals)

    def told(self) -> dict[str, Any]:
        """Return what its row is made of, as plain data."""
        return {**vars(self), "journals": [], "visits": []}

    @property
    def row(self) -> str:
        """The row of the table."""
        time = "" if self.seconds is None else rounded(self.seconds)
        if time and self.limit is not None:
            time += f" (allowed: {self.limit:g} s)"
        outcome = self.outcome if self.verdict == "passed" else f"**{self.verdict}**"
        cells = [self.scenario, self.did or "–", self.shows or "–", outcome or "held", time]
        return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def stood(visits: Iterable[Sequence[AttemptRecord]]) -> str:
    """Return in words how each visit to a leaf ended, alike ones as one."""
    stories = Counter(", then ".join(_in_a_row(map(_stood, each))) for each in visits if each)
    return "; ".join(_times(stories.items()))


def _stood(attempt: AttemptRecord) -> str:
    outcome, end = str(attempt.outcome), str(attempt.end)
    return outcome if outcome == end else f"{outcome}, end {end}"


def _in_a_row(texts: Iterable[str]) -> list[str]:
    return _times((text, len(list(same))) for text, same in groupby(texts))


def _times(counted: Iterable[tuple[str, int]]) -> list[str]:
    return [f"{times} × {text}" if times > 1 else text for text, times in counted]


def last_part(server: str) -> str:
    """The part of a server's name that tells it from others, without a test's own number."""
    return re.sub(r"/t\d+_\d+", "", server).strip("/") or server


def rounded(seconds: float) -> str:
    """Return the seconds as they are worth telling."""
    if seconds < 1.0:
        return "under 1 s"
    return f"about {round(seconds * 2) / 2:g} s" if seconds < 10.0 else f"about {seconds:.0f} s"


def summary(journals: Iterable[Journal]) -> str:
    """Return in words what became of the goals."""
    goals: dict[tuple[str, str], list[str]] = {}
    ends: Counter[str] = Counter()
    twice = most = 0
    for each in journals:
        entries = each.entries()
        known = journal.ends(entries)
        for entry in entries:
            key = (entry.server, entry.goal)
            if key in known and entry.event not in ("step", "cancel_accepted"):
                goals.setdefault(key, []).append(str(entry.event))
        ends += Counter(str(end or "never answered") for end in known.values())
        twice += sum(times > 1 for times in journal.executions(entries).values())
        most = max(most, journal.max_live(entries, killed=each.killed))
    if not goals:
        return "no goal was received"
    stories = _in_a_row(map(_once, goals.values()))
    if len(stories) <= SHOWN:
        told = "; then ".join(stories)
    else:
        told = f"{len(goals)} goals: " + ", ".join(f"{n} {end}" for end, n in ends.items())
    live = ""
    if len(goals) > 1:
        live = f"; {most} live at once" if most > 1 else "; never two live at once"
    return told.replace("_", " ") + live + (f"; **{twice} executed twice**" if twice else "")


def _once(events: list[str]) -> str:
    """Name each event once, in the order of its first time."""
    return ", ".join(dict.fromkeys(events))


def family(docstring: str | None) -> str:
    """Return what the scenarios of a module have in common, as its docstring begins."""
    return (docstring or "").strip().splitlines()[0].partition(".")[0]


def first_paragraph(docstring: str | None) -> str:
    """Return the first paragraph on one line, without a full stop at its end."""
    return " ".join((docstring or "").split("\n\n")[0].split()).rstrip(".")


def sentence(name: str) -> str:
    """Return the name of a test as the sentence that it is."""
    text, _, case = name.removeprefix("test_").partition("[")
    text = text.replace("_", " ")
    shown = case.rstrip("]").replace("_", " ")
    return text[:1].upper() + text[1:] + (f" ({shown})" if shown else "")


def anchor(title: str) -> str:
    """Return the name by which a link leads to a section."""
    return re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-")


def came_out(records: Sequence[Record]) -> str:
    """Return in a paragraph what came out."""
    good = sum(record.verdict == "passed" for record in records)
    skipped = sum(record.verdict.startswith("skipped") for record in records)
    unknown = sum("UNKNOWN" in record.outcome for record in records)
    twice = sum("executed twice**" in record.shows for record in records)
    text = f"{len(records)} scenarios: {good} held, {len(records) - good - skipped} did not"
    text += f", {skipped} were skipped" if skipped else ""
    return (
        f"**What came out.** {text}.\n"
        f"In {unknown} the end of a goal was not known in time, and the run said UNKNOWN. "
        f"In {twice} a second\nserver of one name executed a goal, too; the run canceled or named "
        "that goal.\n"
    )


def overview(families: Mapping[str, Sequence[Record]]) -> list[str]:
    """Return the table of all families."""
    lines = ["| what was tried | scenarios | held |", "|---|---|---|"]
    for title, rows in families.items():
        good = sum(record.verdict == "passed" for record in rows)
        lines.append(f"| [{title}](#{anchor(title)}) | {len(rows)} | {good} |")
    return [*lines, ""]


def write(path: Path, records: Iterable[Record]) -> None:
    """Write the report."""
    families: dict[str, list[Record]] = {}
    for record in records:
        families.setdefault(record.family, []).append(record)
    ran = [record for each in families.values() for record in each]
    lines = [HEAD, came_out(ran), *overview(families), READING]
    for title, rows in families.items():
        lines += [f"## {title}\n"]
        lines += ["| scenario | what was done | the journal shows | outcome | time to outcome |"]
        lines += ["|---|---|---|---|---|"]
        lines += [record.row for record in rows]
        lines += [""]
    path.write_text("\n".join(lines), encoding="utf-8")


def names(report: str) -> list[tuple[str, str]]:
    """Return the family and the scenario of each row of a report."""
    tables = [section.partition("\n") for section in report.split("\n## ")[1:]]
    return [
        (title, row.replace("\\|", "|"))
        for title, _, table in tables
        for row in re.findall(r"^\| (.*?) \| ", table, re.MULTILINE)[1:]
    ]
