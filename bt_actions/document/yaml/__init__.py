"""The text of a document and its YAML nodes, each with its place. Knows no tree.

Bounds of bytes, depth and nodes are kept here, so rooms above need none.
"""
