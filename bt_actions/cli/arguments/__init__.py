"""What stands on a command line, read: options, ROS arguments, values, the tree that is meant."""
