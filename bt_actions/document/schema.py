"""JSON Schema of the tree language, made from the model, for completion in editors.

A node may have one key that the schema does not know: an action's alias is a word of the file.
"""

from __future__ import annotations

from bt_actions.document.kinds import KINDS
from bt_actions.document.language.keys import ACTION_KEYS, LIBRARY_KEYS, TOP_KEYS
from bt_actions.document.language.kinds import Kind
from bt_actions.document.language.scalars import Schema
from bt_actions.document.language.shapes import Key, keys_schema


def json_schema() -> Schema:
    """Return the schema of a tree, or of a file that trees import (JSON Schema 2020-12)."""
    kinds = {name: _kind(kind) for name, kind in KINDS.items()}
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "bt_actions tree",
        "description": "A behaviour tree whose leaves are ROS 2 actions.",
        "anyOf": [
            {**keys_schema(TOP_KEYS), "title": "a tree"},
            {
                **keys_schema(LIBRARY_KEYS),
                "title": "a file that trees import",
                "not": {"required": ["root"]},
            },
        ],
        "$defs": {
            "node": {
                "type": "object",
                "anyOf": [
                    *({"$ref": f"#/$defs/{name}"} for name in KINDS),
                    {"$ref": "#/$defs/use_of_an_action"},
                ],
            },
            **kinds,
            "use_of_an_action": _alias(),
        },
    }


def _kind(kind: Kind) -> Schema:
    own = Key(kind.name, kind.value, kind.doc, required=True)
    return {"title": kind.name, **keys_schema({kind.name: own, **kind.keys})}


def _alias() -> Schema:
    """Return the schema of one key that is no kind, and of the keys of an action beside it."""
    schema = keys_schema(ACTION_KEYS)
    schema.pop("additionalProperties")
    settings = sorted(ACTION_KEYS)
    return {
        "title": "an action that the tree declares under 'actions'",
        **schema,
        "propertyNames": {"not": {"enum": sorted(set(KINDS) - set(settings))}},
        "minProperties": 1,
        "maxProperties": len(settings) + 1,
    }
