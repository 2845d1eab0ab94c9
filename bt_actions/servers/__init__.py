"""The facts about servers: their presence, reachability and replies. No ROS, no thread."""
