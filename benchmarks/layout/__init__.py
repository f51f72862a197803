"""Zones, labels and classes of pages; documents, many models, discovery."""
