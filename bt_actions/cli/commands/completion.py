"""`bt-actions completion bash|zsh|fish`: a completion script, made from the parsers themselves.

Knows no command by name: a new option is completed because its parser has it. What a TREE, a CODE
or a fault may be is read when the script is made, so that completing itself starts no Python.
"""

from __future__ import annotations

import argparse
import contextlib
import functools
from dataclasses import dataclass
from typing import TYPE_CHECKING

from bt_actions.cli.exits import Exit
from bt_actions.cli.streams.writing import write

if TYPE_CHECKING:
    from bt_actions.cli.arguments.parser import Subparsers

_EPILOG = """\
examples:
  source <(bt-actions completion bash)
  source <(bt-actions completion zsh)
  bt-actions completion fish > ~/.config/fish/completions/bt-actions.fish
"""


@dataclass(frozen=True, slots=True)
class Option:
    """What a shell needs to know of one option."""

    names: tuple[str, ...]
    help: str
    takes_value: bool
    choices: tuple[str, ...]
    metavar: str


@dataclass(frozen=True, slots=True)
class CommandWords:
    """What a shell needs to know of one command."""

    name: str
    help: str
    options: tuple[Option, ...]
    words: tuple[str, ...]
    """What its first argument may be; empty: a file."""
    files: bool
    """Whether it may also be a file."""


def add_parser(subparsers: Subparsers) -> None:
    """Add the command's parser."""
    parser = subparsers.add_parser(
        "completion",
        help="print a completion script for a shell",
        description="Print a script that completes commands, options and files in a shell.",
        epilog=_EPILOG,
    )
    parser.add_argument("shell", choices=sorted(_SCRIPTS), help="the shell to complete in")
    parser.set_defaults(subparsers=subparsers)  # which has all commands when this one runs


def run(args: argparse.Namespace) -> int:
    """Print the script for the shell that `args` name."""
    subparsers: Subparsers = args.subparsers
    helps = {each.dest: each.help or "" for each in subparsers._choices_actions}  # noqa: SLF001
    commands = [_command(name, helps[name], sub) for name, sub in subparsers.choices.items()]
    write(_SCRIPTS[args.shell](commands))
    return Exit.SUCCESS


def _command(name: str, text: str, parser: argparse.ArgumentParser) -> CommandWords:
    options: list[Option] = []
    words: tuple[str, ...] = ()
    files = False
    for action in parser._actions:  # noqa: SLF001 - argparse has no public way to read a parser
        choices = tuple(str(choice) for choice in action.choices or ())
        if action.option_strings:
            help_text = (action.help or "").replace("%%", "%")
            options.append(
                Option(tuple(action.option_strings), help_text, action.nargs != 0, choices,
                       str(action.metavar))
            )  # fmt: skip
        elif choices:
            words = choices
            if isinstance(action, argparse._SubParsersAction):  # noqa: SLF001
                files = True
                below = [_command(name, text, each) for name, each in action.choices.items()]
                options += {
                    option.names: option for each in below for option in each.options
                }.values()
        elif action.metavar == "TREE":
            words, files = tuple(_inputs_of_trees()), True
        elif action.metavar == "CODE":
            words = _codes()
    return CommandWords(name, text, tuple(options), words, files)


@functools.cache
def _inputs_of_trees() -> dict[str, list[str]]:
    """The names of the inputs of every installed tree; files that hold no tree are left out."""
    from bt_actions.document import DocumentError, tree_inputs
    from bt_actions.document.reading.find import installed_trees

    found = {}
    for name in installed_trees():
        with contextlib.suppress(DocumentError):
            found[name] = list(tree_inputs(name))
    return found


def _codes() -> tuple[str, ...]:
    from bt_actions.document.findings.rules import RULES

    return tuple(RULES)


def _bash(commands: list[CommandWords]) -> str:
    names = " ".join(command.name for command in commands)
    lines = [
        "# bash completion for bt-actions",
        "_bt_actions() {",
        '    local word="${COMP_WORDS[COMP_CWORD]}" before="${COMP_WORDS[COMP_CWORD-1]}"',
        '    if [ "$COMP_CWORD" -eq 1 ]; then',
        f"        {_offer(names, '--help --version')}",
        "        return",
        "    fi",
        *_bash_faults(),
        '    case "${COMP_WORDS[1]} $before" in',
    ]
    for command in commands:
        for option in command.options:
            if option.metavar in _BASH_VALUES:
                lines += [
                    f'        "{command.name} {name}") {_BASH_VALUES[option.metavar]}; return ;;'
                    for name in option.names
                ]
            if option.choices:
                pattern = "|".join(f'"{command.name} {name}"' for name in option.names)
                words = " ".join(option.choices)
                lines.append(f"        {pattern}) {_offer(words)}; return ;;")
    lines += ["    esac", '    case "${COMP_WORDS[1]}" in']
    for command in commands:
        options = " ".join(name for option in command.options for name in option.names)
        words = " ".join(command.words)
        lines.append(
            f'        {command.name}) case "$word" in '
            f"-*) {_offer(options)} ;; "
            f"*) {_offer(words, files=command.files)} ;; esac ;;"
        )
    lines += [
        "    esac",
        "}",
        *_bash_inputs(),
        "complete -o filenames -F _bt_actions bt-actions",
        "",
    ]
    return "\n".join(lines)


_BASH_VALUES = {"NAME=VALUE": "_bt_actions_inputs", "SPEC": "_bt_actions_server"}
"""Functions of the script that offer values for options, by their metavar."""


def _bash_faults() -> list[str]:
    """Faults are written SERVER:N:FAULT, and bash takes the colons for words of their own."""
    from bt_actions.simulation.faults import FaultKind

    faults = " ".join(FaultKind)
    return [
        '    local colon=$((COMP_CWORD - 1)) last="$word"',
        '    if [ "$word" = ":" ]; then colon=$COMP_CWORD last=""; fi',
        '    if [ "$colon" -ge 4 ] && [ "${COMP_WORDS[colon]}" = ":" ] &&',
        '        [ "${COMP_WORDS[colon-4]}" = "--fault" ]; then',
        f'        mapfile -t COMPREPLY < <(compgen -W "{faults}" -- "$last")',
        "        return",
        "    fi",
    ]


def _bash_inputs() -> list[str]:
    """Offer the inputs of the tree that stands on the line, and the simulated servers."""
    from bt_actions.cli.driving.simulated import SERVED

    servers = " ".join(f"{name}:" for name in SERVED.values())
    cases = [
        f'            {name}|{name}.yaml|*/{name}.yaml) names="'
        + " ".join(f"{one}=" for one in inputs)
        + '" ;;'
        for name, inputs in _inputs_of_trees().items()
        if inputs
    ]
    return [
        "_bt_actions_inputs() {",
        '    local tree names=""',
        '    for tree in "${COMP_WORDS[@]:2}"; do',
        '        case "$tree" in',
        *cases,
        "        esac",
        "    done",
        '    mapfile -t COMPREPLY < <(compgen -W "$names" -- "$word")',
        "    compopt -o nospace 2>/dev/null",
        "}",
        "_bt_actions_server() {",
        f'    mapfile -t COMPREPLY < <(compgen -W "{servers}" -- "$word")',
        "    compopt -o nospace 2>/dev/null",
        "}",
    ]


def _offer(*words: str, files: bool = False) -> str:
    """Offer those of `words` that fit, or files where there are none; one offer a line."""
    given = " ".join(words)
    source = f'-W "{given}"' if given else "-f"
    if given and files:
        source += " -f"
    return f'mapfile -t COMPREPLY < <(compgen {source} -- "$word")'


def _zsh(commands: list[CommandWords]) -> str:
    lines = [
        "#compdef bt-actions",
        "# zsh completion for bt-actions",
        "_bt_actions() {",
        "    if (( CURRENT == 2 )); then",
        "        local -a commands=(",
        *(f"            {_quote(f'{c.name}:{c.help}')}" for c in commands),
        "        )",
        "        _describe command commands",
        "        return",
        "    fi",
        "    local command=$words[2]",
        "    shift words",
        "    (( CURRENT-- ))",
        '    case "$command" in',
    ]
    for command in commands:
        specs = []
        for option in command.options:
            value = f":value:({' '.join(option.choices)})" if option.choices else ":value:_files"
            text = option.help.replace("[", "(").replace("]", ")").replace(":", "\\:")
            specs += [
                _quote(
                    f"*{name}{_joined(name, option)}[{text}]{value if option.takes_value else ''}"
                )
                for name in option.names
            ]
        words = f"({' '.join(command.words)})" if command.words else "_files"
        if command.files:
            words = f"{{compadd {' '.join(command.words)}; _files}}"
        specs.append(_quote(f"*:argument:{words}"))
        lines.append(f"        {command.name}) _arguments {' '.join(specs)} ;;")
    lines += [
        "    esac",
        "}",
        'if [ "$funcstack[1]" = "_bt_actions" ]; then _bt_actions "$@"',
        "elif (( $+functions[compdef] )); then compdef _bt_actions bt-actions; fi",
        "",
    ]
    return "\n".join(lines)


def _joined(name: str, option: Option) -> str:
    """zsh's sign that a value may also follow in the same word."""
    return "=" if option.takes_value and name.startswith("--") else ""


def _fish(commands: list[CommandWords]) -> str:
    lines = ["# fish completion for bt-actions"]
    for command in commands:
        lines.append(
            f"complete -c bt-actions -n __fish_use_subcommand -f -a {command.name} "
            f"-d {_quote(command.help)}"
        )
        here = f"-n '__fish_seen_subcommand_from {command.name}'"
        if command.words:
            only = "" if command.files else "-f "
            words = _quote(" ".join(command.words))
            lines.append(f"complete -c bt-actions {here} {only}-a {words}")
        for option in command.options:
            names = " ".join(
                f"-l {name[2:]}" if name.startswith("--") else f"-s {name[1:]}"
                for name in option.names
            )
            value = " -r" if option.takes_value else ""
            if option.choices:
                value = f" -x -a {_quote(' '.join(option.choices))}"
            lines.append(f"complete -c bt-actions {here} {names}{value} -d {_quote(option.help)}")
    return "\n".join([*lines, ""])


def _quote(text: str) -> str:
    return "'" + text.replace("'", "'\\''") + "'"


_SCRIPTS = {"bash": _bash, "zsh": _zsh, "fish": _fish}
