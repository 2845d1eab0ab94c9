"""Simulated servers on an rclpy node. Nothing of a robot, and no fault, is decided here."""
