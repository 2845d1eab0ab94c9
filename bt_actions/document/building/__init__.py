"""From a document without errors to py_trees behaviours. Needs no node and no server."""
