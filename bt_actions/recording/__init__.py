"""Recordings of runs: each run leaves its events in a folder of its own, and tells its story again.

`recorder.py` writes on a thread of its own, `reading.py` reads whatever is left of a file,
`folders.py` knows where runs lie and which are kept. Nothing here ticks, waits for a reader, or
knows ROS; docs/recording.md describes the files.
"""
