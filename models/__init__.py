"""The store of layout graph models, samples, feedback and results."""
