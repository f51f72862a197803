"""Learning from people: feedback and its undo, lessons, samples and their locks."""
