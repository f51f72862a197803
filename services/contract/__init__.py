"""Data that the server sends to a worker and gets back, and the names of the operations. No arrays."""
