"""The language of trees: its kinds and keys, the forms of values, and their types.

Reading, checking, the JSON Schema and docs/yaml.md are made from this room. Knows no document.
"""
