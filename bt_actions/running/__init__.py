"""Running a tree: ticks, the runner, the report of a run."""
