"""The expressions of `{...}`: the reading and the evaluation."""
