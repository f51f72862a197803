"""Composition of the page from the photo that shows each word best (4.4)."""
