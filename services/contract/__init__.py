"""What crosses from the server to a worker and back: plain data, and the names of the operations. No arrays."""
