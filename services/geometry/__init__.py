"""Homographies, the pin-hole camera, lines and vanishing points, meshes."""
