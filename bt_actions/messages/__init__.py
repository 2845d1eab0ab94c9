"""ROS messages from plain data and back. No node is needed."""
