"""The review queue: which pages a person shall see, and in which order."""
