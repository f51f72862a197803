"""A sheet with creases: an inextensible mesh, flat but for few ridges.

It starts between the four sides (`start`, `cylinder_start`) and is fitted coarse to fine (`fitting`): lines level,
evenly spaced and flush, strokes upright, the outline at the border, edges of their own length, few ridges
(`residuals`, `paper`). It needs the outline: text alone leaves bas-relief transformations open, which a flexible sheet
would use. Where a side is not seen, the smooth surface is fitted instead.
"""
