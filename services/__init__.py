"""What the product knows: bytes or arrays in, results out; no HTTP, no SQL."""
