"""'Did you mean': the closest of the known words, for every message about an unknown one."""

from __future__ import annotations

import difflib
from collections.abc import Collection, Iterable, Mapping

_LONGEST = 60
_MOST = 60
_BEGINNING = 4
"""Letters that stand for the beginning of a longer word rather than for another word."""
_NAMED = 3
"""The most names of one type in other namespaces that a message has."""
_ALIKE = 0.75
"""The least likeness of two full names, which share their namespaces."""


def closest(word: str, known: Iterable[str], *, cutoff: float = 0.6) -> str | None:
    """Return the known word that `word` most likely stands for, or None where nothing is near.

    `cutoff` is the least likeness of two words, 0 to 1.
    """
    if not 0 < len(word) <= _LONGEST:
        return None
    known, wanted = list(known), folded(word)
    longer = [name for name in known if len(word) >= _BEGINNING and name.startswith(word)]
    if longer and word not in longer:
        return min(longer, key=len)
    slack = max(2, len(word) // 3)
    near = [name for name in known if name != word and abs(len(name) - len(word)) <= slack]
    forms = {folded(name): name for name in near}
    if wanted in forms:
        return forms[wanted]
    if len(forms) > _MOST:  # comparing takes its time
        alike = [form for form in forms if form[:1] == wanted[:1]][:_MOST]
        forms = {form: forms[form] for form in alike}
    matches = difflib.get_close_matches(wanted, forms, n=1, cutoff=cutoff)
    return forms[matches[0]] if matches else None


def folded(word: str) -> str:
    """Return a word in one form, the same for `ForceSuccess`, `force-success`, `force_success`."""
    return word.casefold().replace("-", "").replace("_", "").replace(" ", "")


def listing(names: Iterable[str], limit: int = 12) -> str:
    """Return ``a, b and c``, cut where there are many."""
    known = list(names)
    if len(known) > limit:
        return f"{', '.join(known[:limit])} and {len(known) - limit} more"
    return ", ".join(known)


def did_you_mean(word: str, known: Iterable[str], *, cutoff: float = 0.6) -> str:
    """Return ``"; did you mean 'distance'?"``, or ""."""
    near = closest(word, known, cutoff=cutoff)
    return f"; did you mean {near!r}?" if near else ""


def what_it_has(word: str, known: Iterable[str], nothing: str = "") -> str:
    """Return ``"; did you mean 'distance'?"``, or ``"; it has x, y"``; `nothing` for no words."""
    known = list(known)
    return did_you_mean(word, known) or (f"; it has {listing(known)}" if known else nothing)


def elsewhere(name: str, kind: str, known: Mapping[str, Collection[str]]) -> str:
    """Name those of a type with the same last name in other namespaces; or a similar name.

    `known` has the types of each full name.
    """
    of_kind = [each for each, kinds in known.items() if kind in kinds and each != name]
    base = name.rpartition("/")[2]
    found = sorted(each for each in of_kind if each.rpartition("/")[2] == base)
    if found:
        return f"; there is {listing(found, _NAMED)} of that type"
    return did_you_mean(name, of_kind, cutoff=_ALIKE)
