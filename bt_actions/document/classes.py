"""A user's own behaviour class by its name, and whether arguments fit it."""

from __future__ import annotations

import importlib
import inspect
import re
from collections.abc import Mapping

from py_trees.behaviour import Behaviour

from bt_actions.suggest import did_you_mean

__all__ = ["ClassError", "find_behaviour", "wrong_arguments"]

_PATH = re.compile(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)+", re.ASCII)


class ClassError(ValueError):
    """There is no such class, or it is no behaviour."""


def find_behaviour(path: str) -> type[Behaviour]:
    """The class that ``package.module.Class`` names. Imports its module. Raises ClassError."""
    if not _PATH.fullmatch(path):
        raise ClassError(f"{path!r} names no class: it is written package.module.Class")
    module_name, _, name = path.rpartition(".")
    try:
        module = importlib.import_module(module_name)
    except ModuleNotFoundError as error:
        raise ClassError(
            f"there is no module {error.name!r} where Python looks; install its package, or put "
            "the folder it is in on PYTHONPATH"
        ) from None
    except Exception as error:  # noqa: BLE001 - the user's module may raise anything
        raise ClassError(
            f"importing {module_name!r} raised {type(error).__name__}: {error}"
        ) from None
    found = getattr(module, name, None)
    if found is None:
        near = did_you_mean(name, [word for word in vars(module) if not word.startswith("_")])
        raise ClassError(f"the module {module_name!r} has no {name!r}{near}")
    if not isinstance(found, type) or not issubclass(found, Behaviour):
        raise ClassError(f"{path!r} is no py_trees behaviour")
    if inspect.isabstract(found):
        raise ClassError(f"{path!r} is abstract")
    return found


def wrong_arguments(
    cls: type[Behaviour], arguments: Mapping[str, object]
) -> tuple[str, str] | None:
    """The argument that does not fit the constructor (or an empty text) and why, or None."""
    try:
        parameters = inspect.signature(cls).parameters
    except (TypeError, ValueError):
        return None
    named = {
        name: parameter
        for name, parameter in parameters.items()
        if parameter.kind in (parameter.POSITIONAL_OR_KEYWORD, parameter.KEYWORD_ONLY)
    }
    takes_any = any(parameter.kind is parameter.VAR_KEYWORD for parameter in parameters.values())
    for name in arguments:
        if name == "name":
            return name, "the name is given as the node's 'name'"
        if name not in named and not takes_any:
            near = did_you_mean(name, named) or f"; it takes {', '.join(named)}"
            return name, f"{cls.__name__} takes no argument {name!r}{near}"
    for name, parameter in named.items():
        if parameter.default is parameter.empty and name != "name" and name not in arguments:
            return "", f"{cls.__name__} needs the argument {name!r}"
    if "name" not in named and not takes_any:
        return "", f"{cls.__name__} takes no name"
    return None
