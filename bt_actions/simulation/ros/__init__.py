"""Simulated servers on an rclpy node: nothing of a robot, and no fault, is decided here."""
