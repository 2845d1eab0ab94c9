"""Kinds that hold a list of nodes."""
