"""The story of a run, all of it from its events: its state, the reasons, and its end.

`state.py` folds the events, `why.py` gives reasons, `words.py` and `table.py` the texts. Nothing
here looks at a tree, waits, reads a clock or knows ROS: stored events give the same story.
"""
