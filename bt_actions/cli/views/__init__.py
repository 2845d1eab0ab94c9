"""How a run is shown: as lines, as JSON, drawn live, or as one goal. Only writes."""
