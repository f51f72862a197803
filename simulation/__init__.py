"""Photos of pages with their truth (dissertation, Appendix A)."""
