"""What goes around a bug of rclpy, rmw_fastrtps or Fast DDS.

Each file names the bug and how to see that it is needed no more. Must not hold anything else.
"""
