"""The commands, a file each: `add_parser(subparsers)`, and `run(args) -> int`, the exit code.

Slow modules (rclpy, py_trees, rich) are imported within `run`: every call builds all parsers. No
command imports another one.
"""
