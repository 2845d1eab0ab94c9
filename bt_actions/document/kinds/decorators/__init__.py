"""Kinds that hold one node."""
