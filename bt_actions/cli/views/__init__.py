"""The views of a run: as lines, as JSON, drawn live, or as one goal. Only writes."""
