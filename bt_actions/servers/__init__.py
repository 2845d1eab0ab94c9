"""The knowledge of the server on the other side. No ROS, no thread."""
