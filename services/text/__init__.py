"""The text of a flat page with the places of its words, and its files: hOCR, ALTO, plain text, Markdown."""
