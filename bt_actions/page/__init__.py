"""A live page of recorded runs, served to browsers of this machine.

The page reads recordings alone: a run does not know of it, and is not held up by it.
"""
