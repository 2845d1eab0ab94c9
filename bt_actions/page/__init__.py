"""A live page of recorded runs, served to browsers of this machine.

The page reads recordings alone: a run does not know of the page, which never holds a run up.
"""
