"""From YAML nodes to documents: their nodes, the files they name, and their inputs.

Reports what is wrong with the form. Infers no type, and makes no behaviour.
"""
