"""Attacks on the running service: hostile files, bodies and clients, and what each must be answered."""
