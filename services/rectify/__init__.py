"""One photo of a page -> its frontal flat view (dissertation, chapter 3).

`pipeline` has the steps. What a photo shows (`analysis`) lets shapes compete (`shape_choice`), and the best one is
framed, judged, turned and drawn (`view`). What a photo does not show is a value with a reason: a prior decides, and a
warning says so. Only a photo that shows neither text nor a sheet is an error (`NoText`).
"""
