"""Trees in canonical form: what moves, what stays. The meaning never changes."""
