"""A running command: signals, the run of a tree or of a server, and the order of the end."""
