"""Flat page -> photo of it, and the truth (dissertation, Appendix A, and the dirt that it left out).

Nothing here is shared with `services`: the camera below is written a second time on purpose, so that
an error of sign or of order in one of the two shows up instead of cancelling out.
"""
