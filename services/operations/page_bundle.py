"""What is kept of a page: a file of its photo, of how its views are drawn, and of its first picture."""

import io
import json
import zipfile
from dataclasses import dataclass
from typing import cast

from services.contract.kept_pages import PHOTO, WORDS, KeptPage, KeptPageJson, OptionsJson
from services.contract.rectify import Origin, RectifyParameters, TypesetPage
from services.imaging.codec import DEFAULT_QUALITY, encode_image
from services.imaging.page_images import PagePicture
from services.operations.kept_text import keep_text, shown_part
from services.operations.pages_reply import DescribedPage
from services.operations.replies import to_json_ready
from services.rectify.results import RectifyResult
from services.text.page_text import PageText

PLAN, PICTURE = "plan.npz", "picture.jpg"


@dataclass(frozen=True, slots=True)
class PageBundle:
    """`photo` is an image file; `plan` a packed `ViewPlan`; `picture` a JPEG file of the flat page before its look.

    `words` are those of a page that is set in type, in JSON; empty where they are not known.
    The picture is what an answer of `DEFAULT_QUALITY` would have: files of kept pages take it as it is.
    """

    photo: bytes
    plan: bytes
    picture: bytes
    words: bytes = b""

    def packed(self) -> bytes:
        """The file. Its parts are compressed already, or hardly compressible, but for the words."""
        buffer = io.BytesIO()
        with zipfile.ZipFile(buffer, "w", zipfile.ZIP_STORED) as archive:
            for name, part in ((PHOTO, self.photo), (PLAN, self.plan), (PICTURE, self.picture)):
                archive.writestr(zipfile.ZipInfo(name), part)
            if self.words:
                archive.writestr(zipfile.ZipInfo(WORDS), self.words, zipfile.ZIP_DEFLATED)
        return buffer.getvalue()


def open_bundle(packed: bytes) -> PageBundle:
    """The parts of a file that `PageBundle.packed` has made."""
    with zipfile.ZipFile(io.BytesIO(packed)) as archive:
        words = archive.read(WORDS) if WORDS in archive.namelist() else b""
        return PageBundle(archive.read(PHOTO), archive.read(PLAN), archive.read(PICTURE), words)


KEPT_OPTIONS = tuple(OptionsJson.__annotations__)
"""Of `RectifyParameters`: what a page that is analysed again is analysed by."""


def keep_page(
    result: RectifyResult,
    page: DescribedPage,
    parameters: RectifyParameters,
    photo: PagePicture,
    text: PageText | None = None,
) -> KeptPage | None:
    """What is kept of a flat page of `photo`, and of its `text`; None where its views are not known.

    `page` describes `result` at full size. The document has the `answer`, the `options` that made
    the picture, and what the person has said since then (`wish`), nothing so far.
    """
    if result.plan is None:
        return None
    original = photo.original
    if original is None:  # a page of a file of several
        original = encode_image(photo.pixels, "png", dpi=photo.dpi, icc_profile=photo.icc_profile)
    picture = encode_image(result.image, "jpeg", DEFAULT_QUALITY, page.dpi, photo.icc_profile)
    answer = page.answer.model_dump(mode="json", exclude={"timings_ms", "text", "page_id"})
    document = {
        "answer": answer,
        "options": {name: getattr(parameters, name) for name in KEPT_OPTIONS},
        "wish": {},
        "rotation_found": result.orientation.rotation_deg if parameters.page_turn is None else 0,
        "stretch": photo.stretch,
        "is_document": photo.origin != "photo",
        "print_turn": photo.origin.turn if isinstance(photo.origin, TypesetPage) else None,
        "dpi": page.dpi,
        "format": photo.format,
    }
    ready = cast(KeptPageJson, to_json_ready(document))
    if text is not None:
        turn = result.orientation.rotation_deg
        keep_text(ready, shown_part(parameters.crop, parameters.margin, turn, result.plan.packed), text)
    bundle = PageBundle(original, result.plan.packed, picture, _packed_words(photo.origin))
    return KeptPage(bundle.packed(), ready)


def _packed_words(origin: Origin) -> bytes:
    if not isinstance(origin, TypesetPage) or not origin.words:
        return b""
    words = [(word.text, word.box, word.line) for word in origin.words]
    return json.dumps({"has_pictures": origin.has_pictures, "words": words}).encode()
