"""The text of a document and its YAML nodes, each with its place. Knows no tree.

What is read within bounds here (bytes, depth, nodes) needs no bound above.
"""
