"""The shape of a flat page: a plane by its text, by the sides of its sheet, or by straight print."""
