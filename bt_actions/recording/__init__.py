"""Recordings of runs: each run leaves its events in a folder of its own, for its story later.

`recorder.py` writes on a thread of its own, `reading.py` reads all that is left of a file,
`folders.py` knows the places of runs, and which are kept. Nothing here ticks, waits for a reader,
or knows ROS; docs/recording.md describes the files.
"""
