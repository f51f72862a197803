"""The page with its zones and labels drawn on it."""
