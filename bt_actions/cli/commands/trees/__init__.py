"""Commands that write trees."""
