"""OCR: an interface, and its implementations."""
