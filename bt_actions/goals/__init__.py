"""One goal: its policy, its states, its deadlines, attempts and resources. No ROS, no thread.

Read it in this order: terms.py (states, events, commands), table.py (which step is made when),
steps/ (what a step does), facts.py (what the steps know of a goal, and change), goal.py (how a
caller tells a goal what happened). The rest stands beside: policy.py says what a user may want,
attempts.py when a goal is tried again, resources.py who may use what, ids.py whose goal it is.
"""
