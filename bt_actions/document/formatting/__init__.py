"""Trees in canonical form. The meaning of a tree never changes."""
