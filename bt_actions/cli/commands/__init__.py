"""The commands, a file each: `add_parser(subparsers)`, and `run(args) -> int`, the exit code.

What is slow (rclpy, py_trees, rich) is imported within `run`: every call builds all parsers. No
command imports another one.
"""
