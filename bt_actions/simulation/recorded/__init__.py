"""Servers that answer as those of a recorded run did, made from its events."""
