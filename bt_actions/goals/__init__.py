"""One goal: its policy, its states, its deadlines, attempts and resources. No ROS, no thread.

The reading order: terms.py (states, events, commands), table.py (the step for each state and
event), steps/ (the work of each step), facts.py (the facts of a goal, which steps change), goal.py
(the calls of a caller). The rest stands beside: policy.py has the wishes of a user, attempts.py the
tries of a goal, resources.py the holders of names, ids.py the author of a goal.
"""
