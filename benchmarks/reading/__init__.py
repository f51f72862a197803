"""How well pages are read: the product's text beside that of the engine alone."""
