"""HTTP in, HTTP out: no arrays, no numpy, no OpenCV."""

__version__ = "0.1.0"
