"""Accepted jobs under chaos: processes are killed, the database restarts, and nothing is lost or answered twice."""
