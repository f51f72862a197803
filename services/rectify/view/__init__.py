"""The flat view of a page whose shape is known: its frame, its cut, its orientation, its drawing."""
