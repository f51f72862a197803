"""Several overlapping photos of one page -> the whole page (dissertation, chapter 4).

`pipeline` has the steps. There are three frames: photo pixels; flat pixels of a photo's own flat view (`FlatPhoto`), in
which it is registered; mosaic pixels. A `Placement` leads from flat to mosaic pixels, so that the page is drawn from
every photo by one remap.
"""
