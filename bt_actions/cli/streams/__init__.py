"""Standard output and standard error, with readers of any kind."""
