"""On whose behalf this thread begins goals; whoever ticks a tree says so here. Decides nothing."""

from __future__ import annotations

from contextvars import ContextVar

begun_in: ContextVar[object] = ContextVar("begun_in", default=None)
"""What is ticking, as GoalHandle.begun_in tells of each goal; None where nobody has said it."""
