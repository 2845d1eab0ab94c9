"""From a document without errors to py_trees behaviours."""
