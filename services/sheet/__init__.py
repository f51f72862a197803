"""The shape of the paper."""
