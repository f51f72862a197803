"""Access of the app to what is stored, and its upkeep."""
