"""A TrueType font whose one glyph covers no area, for text that is searched and copied but not seen.

A page's picture shows the letters. The font gives every character the same width, so that the box of a word is set by
scaling alone. The outline of its glyph is the diagonal of the em box: it has no area, and yet readers that measure
glyphs find the box of the word. The font has the tables that an embedded font program of a CIDFontType2 must have
(ISO 32000-1, 9.9).
"""

import struct

UNITS = 1000
"""Units of an em."""
WIDTH = 500
"""Advance of every character."""
_GLYPH, _GLYPHS = 1, 2
"""Glyph 0 is .notdef, which PDF/A forbids to use; every character is glyph 1."""
_DIAGONAL = struct.pack(
    ">hhhhhHH3B3h3hx", 1, 0, 0, WIDTH, UNITS, 2, 0, 1, 1, 1, 0, WIDTH, -WIDTH // 2, 0, UNITS, -UNITS // 2
)
"""One contour of three points on the diagonal of the em box (OpenType, glyf)."""


def make_glyphless_font() -> bytes:
    """The font file: 2 glyphs, ascent one em, descent 0."""
    tables = {
        b"glyf": _DIAGONAL,
        b"head": struct.pack(
            ">IIIIHHQQhhhhHHhhh",
            0x00010000, 0x00010000, 0, 0x5F0F3CF5, 0x000B, UNITS, 0, 0, 0, 0, WIDTH, UNITS, 0, 8, 2, 0, 0,
        ),
        b"hhea": struct.pack(
            ">IhhhHhhhhhhhhhhhH", 0x00010000, UNITS, 0, 0, WIDTH, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, _GLYPHS
        ),
        b"hmtx": struct.pack(">HhHh", WIDTH, 0, WIDTH, 0),
        b"loca": struct.pack(">HHH", 0, 0, len(_DIAGONAL) // 2),
        b"maxp": struct.pack(">IHHHHHHHHHHHHHH", 0x00010000, _GLYPHS, 3, 1, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0),
    }  # fmt: skip
    count = len(tables)
    power = 1 << (count.bit_length() - 1)
    directory = struct.pack(
        ">IHHHH", 0x00010000, count, 16 * power, power.bit_length() - 1, 16 * (count - power)
    )
    offset = 12 + 16 * count
    body = b""
    for name, table in sorted(tables.items()):
        padded = table + b"\0" * (-len(table) % 4)
        directory += struct.pack(">4sIII", name, _checksum(padded), offset + len(body), len(table))
        body += padded
    font = directory + body
    adjustment = (0xB1B0AFBA - _checksum(font)) & 0xFFFFFFFF
    place = font.index(struct.pack(">I", 0x5F0F3CF5)) - 4
    return font[:place] + struct.pack(">I", adjustment) + font[place + 4 :]


def glyph_of_every_character(characters: int) -> bytes:
    """`CIDToGIDMap` of a font with CIDs 0 to `characters`: each is the one glyph."""
    return struct.pack(">H", _GLYPH) * (characters + 1)


def _checksum(table: bytes) -> int:
    total: int = sum(struct.unpack(f">{len(table) // 4}I", table)) & 0xFFFFFFFF
    return total
