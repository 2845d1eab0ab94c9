"""The steps of the table, by phase; goals/facts.py has their class."""
