"""A user's own behaviour class: found by its name, its arguments checked, an instance made.

Module and constructor are foreign code: whatever they raise becomes a `ClassError`.
"""

from __future__ import annotations

import contextlib
import importlib
import inspect
import re
import types
import typing
from collections.abc import Collection, Iterator, Mapping
from enum import Enum
from typing import NamedTuple

from py_trees.behaviour import Behaviour

from bt_actions.utilities.plain_text import raised
from bt_actions.utilities.suggest import did_you_mean, listing

Python = bool | Collection[str]
"""The classes that a tree may name: all, none, or those of some packages."""

_PATH = re.compile(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)+", re.ASCII)


class ClassError(ValueError):
    """No such class, a class that is no behaviour, or one that fails to make an instance."""


class Misfit(NamedTuple):
    """An argument that does not fit a constructor ("" for none in particular), and the reason."""

    name: str
    text: str
    at_key: bool = True


def refusal(path: object, python: Python) -> str:
    """Say why a ``python:`` node may not name this class, before any import; or ""."""
    if python is True:
        return ""
    if python is False:
        return "python: is not allowed here, because it runs code that the tree names"
    if isinstance(path, str) and path.partition(".")[0] in python:
        return ""
    named = f"those of {listing(python)}" if python else "none"
    return f"python: may name no other classes here than {named}"


def find_behaviour(path: str) -> type[Behaviour]:
    """Import a module and return its class, by ``package.module.Class``. Raises ClassError."""
    if not _PATH.fullmatch(path):
        raise ClassError(f"{path!r} names no class: it is written package.module.Class")
    module_name, _, name = path.rpartition(".")
    try:
        module = importlib.import_module(module_name)
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # noqa: BLE001 - the user's module may raise anything
        raise ClassError(_not_imported(module_name, error)) from None
    found = getattr(module, name, None)
    if found is None:
        near = did_you_mean(name, [word for word in vars(module) if not word.startswith("_")])
        raise ClassError(f"the module {module_name!r} has no {name!r}{near}")
    if not isinstance(found, type) or not issubclass(found, Behaviour):
        raise ClassError(f"{path!r} is no py_trees behaviour")
    if inspect.isabstract(found):
        raise ClassError(f"{path!r} is abstract")
    return found


def _not_imported(module_name: str, error: BaseException) -> str:
    if isinstance(error, ModuleNotFoundError) and error.name is not None:
        return (
            f"there is no module {error.name!r} where Python looks; install its package, or put "
            "the folder it is in on PYTHONPATH"
        )
    return f"importing {module_name!r} raised {raised(error)}"


def make_behaviour(path: str, name: str, arguments: Mapping[str, object]) -> Behaviour:
    """Make a behaviour of the class that `path` names; a text stands for the member of an enum.

    Raises ClassError.
    """
    cls = find_behaviour(path)
    wanted = _parameters(cls) or {}
    given = {key: _meant(_type_of(wanted.get(key)), value) for key, value in arguments.items()}
    try:
        made: object = cls(name=name, **given)
    except KeyboardInterrupt:
        raise
    except BaseException as error:
        raise ClassError(f"making a {cls.__name__} raised {raised(error)}") from error
    if not isinstance(made, Behaviour):
        raise ClassError(f"{path!r} makes no behaviour, but a {type(made).__name__}")
    if not hasattr(made, "children") or not hasattr(made, "parent"):
        raise ClassError(f"the constructor of {cls.__name__} does not call super().__init__(name)")
    return made


def wrong_arguments(cls: type[Behaviour], arguments: Mapping[str, object]) -> Iterator[Misfit]:
    """Yield what keeps the constructor from taking the arguments.

    A missing argument is told where nothing else is wrong: it may be there under another name.
    """
    parameters = _parameters(cls)
    if parameters is None:
        return
    named = {
        name: parameter
        for name, parameter in parameters.items()
        if parameter.kind in (parameter.POSITIONAL_OR_KEYWORD, parameter.KEYWORD_ONLY)
    }
    takes_any = any(parameter.kind is parameter.VAR_KEYWORD for parameter in parameters.values())
    wrong = False
    for name, value in arguments.items():
        misfit = _misfit(cls, name, value, named, takes_any=takes_any)
        if misfit is not None:
            wrong = True
            yield misfit
    if wrong:
        return
    for name, parameter in named.items():
        if parameter.default is parameter.empty and name != "name" and name not in arguments:
            yield Misfit("", f"{cls.__name__} needs the argument {name!r}")
    for name, parameter in parameters.items():
        if parameter.kind is parameter.POSITIONAL_ONLY and parameter.default is parameter.empty:
            yield Misfit("", f"{cls.__name__} takes {name!r} by its position only")
            return
    if "name" not in named and not takes_any:
        yield Misfit("", f"{cls.__name__} takes no name")


def _misfit(
    cls: type[Behaviour],
    name: str,
    value: object,
    named: Mapping[str, inspect.Parameter],
    *,
    takes_any: bool,
) -> Misfit | None:
    """Return what is wrong with one argument."""
    if name == "name":
        return Misfit(name, "the name is given as the node's 'name'")
    if name not in named:
        near = did_you_mean(name, named) or f"; it takes {', '.join(named)}"
        text = f"{cls.__name__} takes no argument {name!r}{near}"
        return None if takes_any else Misfit(name, text)
    wanted = named[name].annotation  # a default alone refuses nothing
    if _takes(wanted, value):
        return None
    text = f"{cls.__name__} takes a {name!r} of type {_annotation(wanted)}, not {value!r:.60}"
    members = [member for kind in _enums_in(wanted) for member in kind.__members__]
    if members:
        text += f": one of {listing(members)}"
    return Misfit(name, text, at_key=False)


def _parameters(cls: type[Behaviour]) -> Mapping[str, inspect.Parameter] | None:
    """Return the parameters of a constructor, their types resolved where that is possible."""
    try:
        parameters = inspect.signature(cls).parameters
    except (TypeError, ValueError):
        return None
    names = getattr(inspect.unwrap(cls.__init__), "__globals__", {})
    return {name: _resolved(parameter, names) for name, parameter in parameters.items()}


def _resolved(parameter: inspect.Parameter, names: dict[str, object]) -> inspect.Parameter:
    """Resolve a parameter whose type is a text; return it unchanged where that fails."""

    def alone() -> None:
        pass

    alone.__annotations__ = {"it": parameter.annotation}
    try:  # the text may be any code, and name what is not there
        found = inspect.get_annotations(alone, globals=names, eval_str=True)
    except KeyboardInterrupt:
        raise
    except BaseException:  # noqa: BLE001 - SystemExit, too
        return parameter
    return parameter.replace(annotation=found["it"])


def _type_of(parameter: inspect.Parameter | None) -> object:
    """Return the annotated type of a parameter, or the enum that its default is a member of."""
    if parameter is None:
        return inspect.Parameter.empty
    bare = parameter.annotation is parameter.empty and isinstance(parameter.default, Enum)
    return type(parameter.default) if bare else parameter.annotation


def _meant(annotation: object, value: object) -> object:
    """Convert a value to the annotated type: members of enums replace their names."""
    parts = typing.get_args(annotation)
    if typing.get_origin(annotation) in (typing.Union, types.UnionType):
        taken = next((part for part in parts if _takes(part, value)), None)
        return value if taken is None else _meant(taken, value)
    if isinstance(annotation, type) and issubclass(annotation, Enum):
        member = _member(annotation, value)
        return value if member is None else member
    if parts and isinstance(value, list):
        return [_meant(parts[0], one) for one in value]
    if parts and isinstance(value, dict):
        return {key: _meant(parts[-1], one) for key, one in value.items()}
    return value


def _member(kind: type[Enum], value: object) -> Enum | None:
    """Return an enum's member by its name, ``FAST`` or ``Mode.FAST``, or by its number or text."""
    if isinstance(value, str):
        *before, name = value.split(".")
        if name in kind.__members__ and before[-1:] in ([], [kind.__name__]):
            return kind[name]
    if issubclass(kind, (int, str)) and isinstance(value, (int, str)):
        with contextlib.suppress(Exception):  # an enum may have code for what it does not know
            return kind(value)
    return None


def _enums_in(annotation: object) -> Iterator[type[Enum]]:
    if isinstance(annotation, type) and issubclass(annotation, Enum):
        yield annotation
    for part in typing.get_args(annotation):
        yield from _enums_in(part)


def _takes(annotation: object, value: object) -> bool:
    """Return whether a value is of the annotated type, or the annotation does not tell."""
    if typing.get_origin(annotation) in (typing.Union, types.UnionType):
        return any(_takes(part, value) for part in typing.get_args(annotation))
    plain = typing.get_origin(annotation) or annotation
    if plain is None or plain is types.NoneType:
        return value is None
    if plain is float:
        return isinstance(value, (int, float)) and not isinstance(value, bool)
    if plain is int:
        return isinstance(value, int) and not isinstance(value, bool)
    if isinstance(plain, type) and issubclass(plain, Enum):
        return _member(plain, value) is not None
    parts = typing.get_args(annotation)
    if plain is list:
        return isinstance(value, list) and all(_takes(part, one) for part in parts for one in value)
    if plain is dict:
        values = value.values() if isinstance(value, dict) else ()
        return isinstance(value, dict) and all(_takes(parts[-1], one) for one in values if parts)
    for kind in (bool, str):
        if plain is kind:
            return isinstance(value, kind)
    return True


def _annotation(annotation: object) -> str:
    """Return a type as its author reads it: without the modules of its parts."""
    if isinstance(annotation, type):
        return annotation.__name__
    return re.sub(r"\b([A-Za-z_]\w*\.)+", "", str(annotation))
