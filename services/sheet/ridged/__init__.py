"""A sheet with creases: an inextensible mesh, flat but for few ridges."""
