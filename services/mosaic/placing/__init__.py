"""Placement of all photos on one page, in a common frontal frame."""
