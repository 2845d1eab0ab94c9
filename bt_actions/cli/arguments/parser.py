"""The argument parser of all commands: no abbreviations, examples kept as written, suggestions.

An unknown command or option is answered with the nearest known one, on one line.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from typing import Any, NoReturn, TypeAlias

from bt_actions.cli.arguments.values import meant_by
from bt_actions.cli.exits import Exit
from bt_actions.cli.streams.writing import write
from bt_actions.utilities.shorten import fit
from bt_actions.utilities.suggest import did_you_mean

Subparsers: TypeAlias = "argparse._SubParsersAction[Parser]"  # noqa: SLF001 - no public name
_PARAMETER = ("-p", "--param")
_OF_ROS = (*_PARAMETER, "--params-file", "-r", "--remap")
"""Options that have a meaning behind --ros-args alone."""


class Parser(argparse.ArgumentParser):
    """argparse with this program's habits; subparsers are of the same class."""

    def __init__(self, **settings: Any) -> None:  # argparse's own keyword arguments
        settings.setdefault("formatter_class", argparse.RawDescriptionHelpFormatter)
        settings.setdefault("allow_abbrev", False)
        super().__init__(**settings)

    @property
    def commands(self) -> dict[str, argparse.ArgumentParser]:
        """The parser of each command; empty for a command's own parser."""
        for action in self._actions:
            if isinstance(action, argparse._SubParsersAction):  # noqa: SLF001 - no public name
                return dict(action.choices)
        return {}

    def parse(self, arguments: Sequence[str]) -> argparse.Namespace:
        """Parse `arguments`; print one line and exit with 2 where they are wrong."""
        command = next((word for word in arguments if not word.startswith("-")), None)
        if command is None or command not in self.commands:
            if command is not None:
                self.error(f"no command {command!r}{_suggestion(command, self.commands)}")
            args = self.parse_args(arguments)
            self.error("which command? `bt-actions --help` lists them")
        args, unknown = self.parse_known_args(arguments)
        if unknown:
            parser: argparse.ArgumentParser = self
            for word in arguments:
                if isinstance(parser, Parser) and word in parser.commands:
                    parser = parser.commands[word]
            assert isinstance(parser, Parser)
            parser.refuse(unknown, getattr(args, "set", ()))
        return args

    def refuse(self, unknown: Sequence[str], settings: Sequence[str] = ()) -> NoReturn:
        """Report arguments that no option takes; `settings` are the words of --set."""
        word = unknown[0]
        options = [name for action in self._actions for name in action.option_strings]
        is_value = not word.startswith("-") or word[1:2].isdigit()
        if "--set" in options and is_value:
            named = [each for each in settings if "=" not in each][:1]
            if meant := meant_by([*named, *unknown]) or meant_by([*named, "VALUE"]):
                self.error(f"unexpected argument {word!r}; write --set {meant}")
        if word in _OF_ROS and "--ros-args" in options:
            is_input = "--set" in options and word in _PARAMETER
            also = meant_by(unknown[1:]) if is_input else ""
            remedy = f"--ros-args {' '.join(unknown[:2])}{also and f', or --set {also}'}"
            self.error(f"no option {word} before --ros-args; write {remedy}")
        if word.startswith("-"):
            name = word.split("=", 1)[0]
            self.error(f"no option {name}{_suggestion(name, options)}")
        self.error(f"unexpected argument {word!r}")

    def _print_message(self, message: str, file: Any = None) -> None:
        """Print as argparse does, but raise an error for lost output."""
        if file is sys.stdout:
            write(message)
        else:
            super()._print_message(message, file)

    def error(self, message: str) -> NoReturn:
        """Print `message` on one line and exit with 2."""
        self.exit(Exit.BAD_INPUT, f"{fit(f'{self.prog}: {message}')}\n")


def _suggestion(word: str, known: Sequence[str] | dict[str, Any]) -> str:
    return did_you_mean(word, known) or "; there are " + ", ".join(known)
