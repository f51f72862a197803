"""The algorithms: bytes or arrays in, results out; no HTTP, no SQL."""
