"""A map of BehaviorTree.CPP's leaves: a file of nodes of ours with ports in them.

```yaml
import: {words.yaml: {move: my_msgs/action/Move}}    # what files declare, for trees that use it
topics: {door: {topic: door, type: std_msgs/msg/Bool}}      # written into trees that use it
constants: {RED: 1}          # names of enums in scripts
nodes:
  MoveTo:
    move:                    # the name in the XML goes here, or under `name`
    goal: {target: $pose, speed: $speed}
    save: {reached: result.pose}
    ports: {pose: geometry_msgs/msg/PoseStamped, speed: {type: float64, default: 0.5}}
```

`$port` stands for what the XML gives; what is written with a port that it does not give is left
out. The keys of `save` and the like are ports, too: the variables that get the values.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

import yaml

SAVES = ("save", "save_on_failure", "save_feedback", "set")
WORDS = ("actions", "topics", "kinds")
_SECTIONS = ("description", "import", "constants", "nodes", *WORDS)


class MapError(ValueError):
    """A map that cannot be used, and why."""


@dataclass(frozen=True, slots=True)
class Leaf:
    """A node of ours in which `$port` stands for a value in the XML."""

    node: Mapping[str, Any]
    ports: Mapping[str, Mapping[str, Any]]
    """Type and default of each port by its name, as far as they are known."""

    @property
    def outputs(self) -> frozenset[str]:
        """The ports that the leaf writes."""
        return frozenset(port for key in SAVES for port in self.node.get(key) or ())

    def type_of(self, port: str) -> str:
        """Return the type of a port, or ""."""
        return str(self.ports.get(port, {}).get("type", ""))


@dataclass(slots=True)
class Map:
    """Leaves by their IDs, and the declarations of their words."""

    leaves: dict[str, Leaf] = field(default_factory=dict)
    words: dict[str, dict[str, Any]] = field(default_factory=dict)
    """The declarations under `actions`, `topics` and `kinds`."""
    imports: dict[str, tuple[str, str]] = field(default_factory=dict)
    """The file that declares an action or a topic, and its type, by name."""
    constants: dict[str, int] = field(default_factory=dict)

    def section_of(self, name: str) -> str | None:
        """Return the section that declares a word, or None."""
        return next((section for section, words in self.words.items() if name in words), None)

    def is_word(self, name: str) -> bool:
        """Return whether a name is an action, a topic or a kind."""
        return name in self.imports or self.section_of(name) is not None


@cache
def nav2() -> Map:
    """Return the map of Nav2's nodes."""
    text = files(__package__).joinpath("nav2.yaml").read_text(encoding="utf-8")
    return _read(yaml.safe_load(text), "nav2.yaml")


def read_map(path: Path) -> Map:
    """Read a map; Nav2's fills the rest. Raises MapError."""
    try:
        data = yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise MapError(f"{path}: this cannot be read: {error.strerror}") from None
    except (ValueError, yaml.YAMLError) as error:
        raise MapError(f"{path}: this is no YAML: {error}") from None
    own, known = _read(data, str(path)), nav2()
    return Map(
        {**known.leaves, **own.leaves},
        {key: {**known.words.get(key, {}), **own.words.get(key, {})} for key in WORDS},
        {name: each for name, each in known.imports.items() if own.section_of(name) is None}
        | own.imports,
        own.constants,
    )


def _read(data: object, name: str) -> Map:
    data = _mapping(data, f"{name}: a map")
    for key in data.keys() - set(_SECTIONS):
        raise MapError(f"{name}: unknown key {key!r}; a map has {', '.join(_SECTIONS)}")
    found = Map(constants=dict(_mapping(data.get("constants"), f"{name}: constants")))
    for section in WORDS:
        found.words[section] = dict(_mapping(data.get(section), f"{name}: {section}"))
    for file, types in _mapping(data.get("import"), f"{name}: import").items():
        for word, kind in _mapping(types, f"{name}: what {file} declares").items():
            found.imports[word] = file, str(kind)
    for kind, given in _mapping(data.get("nodes"), f"{name}: nodes").items():
        node = dict(_mapping(given, f"{name}: {kind}"))
        ports = _mapping(node.pop("ports", None), f"{name}: the ports of {kind}")
        if not node:
            raise MapError(f"{name}: {kind} has no node")
        forms = {
            port: each if isinstance(each, dict) else {"type": each} for port, each in ports.items()
        }
        found.leaves[str(kind)] = Leaf(node, forms)
    return found


def _mapping(data: object, what: str) -> Mapping[str, Any]:
    if data is None:
        return {}
    if not isinstance(data, dict) or not all(isinstance(key, str) for key in data):
        raise MapError(f"{what} is a mapping of names")
    return data


def texts_in(value: object) -> Iterator[str]:
    """Yield all texts in a value."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, Mapping):
        for inner in value.values():
            yield from texts_in(inner)
    elif isinstance(value, list):
        for inner in value:
            yield from texts_in(inner)
