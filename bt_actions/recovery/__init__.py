"""The goals that a killed process left running, and their cleanup."""
