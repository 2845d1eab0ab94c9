"""Which run begins goals on this thread (a context variable), set by whoever ticks its tree."""

from __future__ import annotations

from contextvars import ContextVar

begun_in: ContextVar[object] = ContextVar("begun_in", default=None)
"""What is ticking, as GoalHandle.begun_in tells of each goal; None where nobody has said it."""
