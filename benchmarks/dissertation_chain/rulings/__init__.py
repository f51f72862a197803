"""Rulings of a curved page, in the photo and in space (dissertation 3.3.3, 3.3.4, Appendix B)."""
