"""The text of a document and its YAML nodes, each with its place. Knows no tree."""
