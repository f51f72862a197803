"""Registration: which photos show the same print, and the map between them (4.3)."""
