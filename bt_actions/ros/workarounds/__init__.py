"""Ways around bugs of rclpy, rmw_fastrtps and Fast DDS.

Each file names its bug and the sign that the file is needed no more. Nothing else belongs here.
"""
