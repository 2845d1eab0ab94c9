"""`make bench`: what is measured, beside a yardstick in the same run; docs/performance.md.

harness.py runs the sides of a family in turns and makes rows of what they took; each other file is
a family. A side is a process of its own (processes.py), so that nothing is warm from another.
"""
