"""Small things that know nothing of trees, goals or ROS."""
