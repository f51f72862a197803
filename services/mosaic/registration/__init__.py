"""Which photos show the same print, and where it lies in both (4.3)."""
