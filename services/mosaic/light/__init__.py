"""Equal light in all photos: matched gains, normalized levels (4.4)."""
