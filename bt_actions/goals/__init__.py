"""One goal: its policy, its states, its deadlines, attempts and resources. No ROS, no thread."""
