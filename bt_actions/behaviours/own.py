"""Behaviours of a user's own as nodes of a tree: their inputs are read, their outputs written."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_actions.expressions.text import ExpressionError


class Inputs:
    """The inputs of a node; a read computes the value, and may raise ExpressionError."""

    _values: Mapping[str, Callable[[], object]]

    def __init__(self, values: Mapping[str, Callable[[], object]]) -> None:
        self.__dict__["_values"] = values

    def __getattr__(self, name: str) -> object:
        if name not in self._values:
            raise AttributeError(f"the kind declares no input {name!r}")
        return self._values[name]()


class Outputs:
    """The outputs of a node: set in a visit, and written when the visit ends."""

    _names: Collection[str]
    _given: dict[str, object]

    def __init__(self, names: Collection[str]) -> None:
        self.__dict__.update(_names=names, _given={})

    def __setattr__(self, name: str, value: object) -> None:
        if name not in self._names:
            raise AttributeError(f"the kind declares no output {name!r}")
        self._given[name] = value


def equip(
    behaviour: Behaviour,
    inputs: Mapping[str, Callable[[], object]],
    outputs: Collection[str],
    write: Callable[[Mapping[str, object]], None],
) -> None:
    """Give a behaviour `inputs` and `outputs`.

    `write` is called with all set outputs as a visit ends; a ValueError there, or an input without
    a value, fails the behaviour.
    """
    behaviour.inputs = Inputs(inputs)  # type: ignore[attr-defined]
    behaviour.outputs = Outputs(outputs)  # type: ignore[attr-defined]
    given: dict[str, object] = vars(behaviour.outputs)["_given"]  # type: ignore[attr-defined]
    tick = behaviour.tick

    def ticked() -> Iterator[Behaviour]:
        if behaviour.status is not Status.RUNNING:
            given.clear()
        try:
            for node in tick():
                if node is not behaviour:
                    yield node
            if behaviour.status in (Status.SUCCESS, Status.FAILURE):
                write(dict(given))
        except ExpressionError as error:
            behaviour.stop(Status.INVALID)
            behaviour.status, behaviour.feedback_message = Status.FAILURE, str(error)
        yield behaviour

    behaviour.tick = ticked  # type: ignore[method-assign]
