"""Texture flow of document images (dissertation, chapter 2)."""
