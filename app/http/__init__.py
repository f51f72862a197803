"""What every request passes: bodies and their limits, formats, problems, paths, and how responses travel."""
