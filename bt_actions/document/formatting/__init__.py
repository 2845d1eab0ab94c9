"""Trees in canonical form."""
