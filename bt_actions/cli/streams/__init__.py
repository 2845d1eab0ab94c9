"""Where text goes: standard output and standard error, whatever their readers do."""
