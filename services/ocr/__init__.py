"""Reading text: a small seam, and the engines behind it."""
