"""Decoding, encoding, illumination, binarization and resampling of images."""
