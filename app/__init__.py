"""HTTP in, HTTP out: no arrays, no numpy, no OpenCV."""
