"""The steps of the table, by phase. What a step is stands in goals/facts.py."""
