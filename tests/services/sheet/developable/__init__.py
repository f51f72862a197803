"""Tests of the developable surface, its derivatives, and its fit."""
