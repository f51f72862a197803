"""Pieces of one zone that segmentation divided: found by their labels and put together."""
