"""One light over all photos: gains matched, levels normalized (4.4)."""
