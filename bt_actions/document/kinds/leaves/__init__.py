"""Kinds that hold nothing."""
