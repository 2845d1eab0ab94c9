"""`bt-actions`: the command line."""

from bt_actions.cli.program import main

__all__ = ["main"]
