"""A developable page as planar strips between its rulings: shape and flat view (dissertation 3.3.5, 3.3.6)."""
