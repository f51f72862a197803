"""An invisible text layer for PDFs of page pictures, and PDF/A-2b.

The layer is written with pikepdf, which the encoder of PDFs needs anyway. Tesseract's own renderer reads the picture
again and re-encodes it, cannot take words that were read in another order, and needs a font file
with its language data.
"""

import io
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from struct import pack

import pikepdf
from PIL import ImageCms

from services.contract.images import PdfVersion
from services.documents.glyphless_font import UNITS, WIDTH, glyph_of_every_character, make_glyphless_font
from services.imaging.page_images import POINTS_PER_INCH
from services.ocr.engine import Word
from services.text.page_text import Box, PageText, ReadLine, is_right_to_left, needs_space

SOFTWARE = "document-rectification"
_LOW_WORD = 0.6
"""Punctuation lower than this share of its line (a dash, a comma) gets the line's rows, so that it stays in the line.
Words of letters without ascenders are as low (0.45 to 0.55), and keep their own rows."""
_ICC_DATE = slice(24, 36)
"""Bytes of an ICC profile with its date (ICC.1:2010, 7.2.8)."""
_SRGB_DATE = (1999, 10, 18, 0, 0, 0)
"""Of IEC 61966-2-1."""
_MOST_RANGES = 100
"""Entries of a `bfchar` section (Adobe Technical Note 5014)."""


@dataclass(frozen=True, slots=True)
class PdfFacts:
    """What a PDF says about itself: title, BCP 47 tag of its language (both may be empty), and its version."""

    title: str = ""
    language: str = ""
    version: PdfVersion = "1.7"


def finish_pdf(
    pdf: bytes,
    texts: Sequence[PageText | None],
    facts: PdfFacts,
    dpis: Sequence[float],
) -> bytes:
    """The PDF of page pictures with a text layer under every picture, a title and a language.

    Parameters
    ----------
    pdf
        One picture a page.
    texts
        Text of every page; None: the page gets no text layer.
    facts
        Title, language, and whether the file is PDF/A-2b.
    dpis
        Pixels of every page per inch.
    """
    with pikepdf.open(io.BytesIO(pdf)) as document:
        written = [text for text in texts if text is not None and text.words]
        characters = sorted({character for text in written for word in text.words for character in word.text})
        codes = {character: code for code, character in enumerate([" ", *characters], 1)}
        font = _add_font(document, codes) if written else None
        for page, text, dpi in zip(document.pages, texts, dpis, strict=True):
            if font is not None and text is not None and text.words:
                _add_layer(document, page, text, codes, font, dpi)
        _describe(document, facts)
        buffer = io.BytesIO()
        archival = facts.version == "a-2b"
        document.save(
            buffer,
            min_version="1.7",
            linearize=False,
            deterministic_id=True,
            object_stream_mode=pikepdf.ObjectStreamMode.disable
            if archival
            else pikepdf.ObjectStreamMode.generate,
        )
        return buffer.getvalue()


def _add_font(document: pikepdf.Pdf, codes: Mapping[str, int]) -> pikepdf.Object:
    """The empty font in which the characters have the given codes."""
    program = make_glyphless_font()
    box = [0, 0, WIDTH, UNITS]
    file = document.make_stream(program, Length1=len(program))
    descriptor = pikepdf.Dictionary(
        Type=pikepdf.Name.FontDescriptor,
        FontName=pikepdf.Name("/Glyphless"),
        Flags=4,  # symbolic
        FontBBox=box,
        ItalicAngle=0,
        Ascent=UNITS,
        Descent=0,
        CapHeight=UNITS,
        StemV=80,
        FontFile2=file,
    )
    glyphs = zlib.compress(glyph_of_every_character(len(codes)))
    descendant = pikepdf.Dictionary(
        Type=pikepdf.Name.Font,
        Subtype=pikepdf.Name.CIDFontType2,
        BaseFont=pikepdf.Name("/Glyphless"),
        CIDSystemInfo=pikepdf.Dictionary(Registry="Adobe", Ordering="Identity", Supplement=0),
        FontDescriptor=document.make_indirect(descriptor),
        DW=WIDTH,
        CIDToGIDMap=document.make_stream(glyphs, Filter=pikepdf.Name.FlateDecode),
    )
    return document.make_indirect(
        pikepdf.Dictionary(
            Type=pikepdf.Name.Font,
            Subtype=pikepdf.Name.Type0,
            BaseFont=pikepdf.Name("/Glyphless"),
            Encoding=pikepdf.Name("/Identity-H"),
            DescendantFonts=[document.make_indirect(descendant)],
            ToUnicode=document.make_stream(_to_unicode(codes)),
        )
    )


def _to_unicode(codes: Mapping[str, int]) -> bytes:
    """CMap from codes to characters (ISO 32000-1, 9.10.3)."""
    entries = [f"<{code:04X}> <{_utf16(character)}>" for character, code in codes.items()]
    sections = [entries[start : start + _MOST_RANGES] for start in range(0, len(entries), _MOST_RANGES)]
    body = "\n".join(f"{len(part)} beginbfchar\n" + "\n".join(part) + "\nendbfchar" for part in sections)
    return (
        "/CIDInit /ProcSet findresource begin\n12 dict begin\nbegincmap\n"
        "/CIDSystemInfo << /Registry (Adobe) /Ordering (UCS) /Supplement 0 >> def\n"
        "/CMapName /Adobe-Identity-UCS def\n/CMapType 2 def\n"
        "1 begincodespacerange\n<0000> <FFFF>\nendcodespacerange\n"
        f"{body}\nendcmap\nCMapName currentdict /CMap defineresource pop\nend\nend\n"
    ).encode("ascii")


def _utf16(character: str) -> str:
    return character.encode("utf-16-be", "replace").hex().upper()


def _add_layer(
    document: pikepdf.Pdf,
    page: pikepdf.Page,
    text: PageText,
    codes: Mapping[str, int],
    font: pikepdf.Object,
    dpi: float,
) -> None:
    name = page.add_resource(font, pikepdf.Name.Font, pikepdf.Name("/FText"))
    low = float(page.mediabox[0]), float(page.mediabox[1])
    height = float(page.mediabox[3]) - low[1]
    scale = POINTS_PER_INCH / dpi
    parts = ["q BT 3 Tr"]
    for line in text.lines:
        for index, word in enumerate(line.words):
            following = line.words[index + 1] if index + 1 < len(line.words) else None
            spaced = following is None or needs_space(word.text, following.text)
            x0, y0, x1, y1 = _rows_of(word, line)
            box = (low[0] + x0 * scale, low[1] + height - y1 * scale, x1 * scale - x0 * scale)
            parts.append(_show_word(word, box, (y1 - y0) * scale, codes, str(name), spaced))
    parts.append("ET Q")
    layer = document.make_stream("\n".join(parts).encode("ascii"))
    # Under the picture: a viewer that draws invisible text by mistake shows the picture.
    page.contents_add(layer, prepend=True)


def _rows_of(word: Word, line: ReadLine) -> Box:
    """Box of the word in the layer, in pixels."""
    x0, y0, x1, y1 = word.box
    _, top, _, bottom = line.box
    if y1 - y0 < _LOW_WORD * (bottom - top) and not any(map(str.isalnum, word.text)):
        return x0, top, x1, bottom
    return x0, y0, x1, y1


def _show_word(
    word: Word,
    place: tuple[float, float, float],
    height: float,
    codes: Mapping[str, int],
    font: str,
    spaced: bool,
) -> str:
    """Operators that draw a word from `place` (left, bottom, width in points) in the given height, and a space."""
    left, bottom, width = place
    shown = "".join(f"{codes[character]:04X}" for character in word.text)
    space = f"{codes[' ']:04X}" if spaced else ""
    natural = len(word.text) * WIDTH / UNITS * height
    stretch = 100.0 * width / natural
    # Words from right to left are drawn from their right end, mirrored, as Tesseract draws them.
    backwards = is_right_to_left(word.text)
    matrix = f"-1 0 0 1 {left + width:.3f}" if backwards else f"1 0 0 1 {left:.3f}"
    return f"{font} {height:.3f} Tf {stretch:.3f} Tz {matrix} {bottom:.3f} Tm <{shown}{space}> Tj"


@cache
def _srgb_profile() -> bytes:
    """The ICC profile of sRGB, dated as its standard is: by the time of its making, equal pages would differ."""
    profile = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    return profile[: _ICC_DATE.start] + pack(">6H", *_SRGB_DATE) + profile[_ICC_DATE.stop :]


def _describe(document: pikepdf.Pdf, facts: PdfFacts) -> None:
    if facts.language:
        document.Root.Lang = pikepdf.String(facts.language)
    document.Root.ViewerPreferences = pikepdf.Dictionary(DisplayDocTitle=bool(facts.title))
    with document.open_metadata(set_pikepdf_as_editor=False, update_docinfo=True) as metadata:
        if facts.title:
            metadata["dc:title"] = facts.title
        if facts.language:
            metadata["dc:language"] = {facts.language}
        metadata["xmp:CreatorTool"] = SOFTWARE
        metadata["pdf:Producer"] = SOFTWARE
        if facts.version == "a-2b":
            metadata["pdfaid:part"] = "2"
            metadata["pdfaid:conformance"] = "B"
    if facts.version == "a-2b":
        intent = pikepdf.Dictionary(
            Type=pikepdf.Name.OutputIntent,
            S=pikepdf.Name("/GTS_PDFA1"),
            OutputConditionIdentifier=pikepdf.String("sRGB"),
            Info=pikepdf.String("sRGB IEC61966-2.1"),
            DestOutputProfile=document.make_stream(_srgb_profile(), N=3),
        )
        document.Root.OutputIntents = pikepdf.Array([document.make_indirect(intent)])
