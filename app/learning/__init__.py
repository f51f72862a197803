"""Learning from people: feedback and its undo, lessons, samples and their locks.

`feedback` has the whole path of a feedback, step by step; `undo` that of taking it back.
"""
