"""The choice of a page's shape by the evidence."""
