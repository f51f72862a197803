"""Flat views of single photos: simulated ones, real ones, speed."""
