"""A command while it runs: signals, the run of a tree or of a server, and the order of its end."""
