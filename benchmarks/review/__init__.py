"""The review queue: in which order corrections teach most, and what may go through without a person."""
