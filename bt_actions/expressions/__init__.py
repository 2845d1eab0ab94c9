"""The expressions of `{...}`: reading them, and what they come to."""
