"""The reading of a command line: options, ROS arguments, values, the tree."""
