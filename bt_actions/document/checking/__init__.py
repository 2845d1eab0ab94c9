"""What is wrong with a document beyond its form: names, types and hazards."""
