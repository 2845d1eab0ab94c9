"""The language of trees: its kinds and keys, the forms of values, and their types."""
