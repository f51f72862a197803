"""What the service answers. Made from its OpenAPI document; do not edit."""

from __future__ import annotations

import dataclasses
from typing import Any, Literal, TypedDict


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class Appearance:
    """How the ink of a zone looks: print is even and stands on baselines, handwriting and stamps are not."""

    density: float
    """Share of the box that is ink."""
    size: float
    """Mean height of its connected components over the page's glyph height."""
    size_spread: float
    """Standard deviation of the binary logarithm of their heights."""
    stroke: float
    """Mean stroke width over that of the page's print."""
    slant: float
    """How far strokes lean to the right, by height."""
    regularity: float
    """Share of components on one baseline with a neighbour."""


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class Box:
    """A rectangle from its top left to its bottom right, pixels."""

    x0: float
    y0: float
    x1: float
    y1: float


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class CostTerm:
    """One term of the cost: of a zone, or (`other`) of a pair of zones."""

    zone: str
    other: str | None
    attribute: str
    cost: float


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class Decision:
    """Whether the labels may be used without a person, by the feedback so far when the page was
    recognized."""

    action: Literal["accept", "review"]
    tolerated_error: float
    """Largest share of wrong zones among accepted ones, as the operator states it (TOLERATED_ERRORS)."""
    reasons: list[DecisionReason]


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class DecisionReason:
    """Why a page should be reviewed."""

    code: Literal["no-class", "no-evidence", "unsure", "product-differs", "sum-differs"]
    detail: str
    zones: list[str]
    """Ids of the zones that it is about; empty: the whole page."""


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class DocumentClass:
    """How well the page fits one model; for a document, how well its pages fit the models of a class. For a
    document, the version is that of the model of the first page, and the cost is the sum over the pages."""

    name: str
    model_version: int | None
    """null: a person named a class that had not been compared."""
    cost: float | None
    """Least cost of matching the page with the model; null: as above."""
    probability: float
    """1 where a person has verified the class."""


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class DocumentResult:
    """Class of a document of several pages, and a result for each page. A page's `class` is the model, among
    those of the document's class, that gives its labels; null when the page does not fit that class. Its
    `classes` are all models that were compared with the page."""

    id: str
    """Id of the result, as in /layout/results/{id}; feedback goes to the results of the pages."""
    file_name: str | None = None
    """Name of the uploaded image, of a document of the first one, without folders; null: no image came, or
    none with a name."""
    class_: DocumentClass | None
    found: FoundClass | None = None
    """What was found, where feedback has corrected it; absent where there is no difference."""
    classes: list[DocumentClass]
    """All compared classes, most probable first."""
    unknown_probability: float
    pages: list[LayoutResult]
    tables: list[DocumentTable] = dataclasses.field(default_factory=list)
    """Tables of items; one that goes on over several pages is one table."""
    warnings: list[Warning]
    timings_ms: dict[str, float]
    """Of each stage, all pages together."""


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class DocumentTable:
    """A table of a document: the rows of its pages, one below the other."""

    columns: list[str]
    """As in `tables` of the pages."""
    types: list[Literal["text", "date", "amount", "integer", "email", "phone", "postal-code", "pattern"]]
    """As in `tables` of the pages."""
    headers: list[str | None]
    """As on the first of its pages."""
    pages: list[int]
    """For each row the index of its page in `pages` of the document."""
    rows: list[list[ItemCell | None]]
    checks: TableChecks | None = None
    """`unlike_rows` are indices of `rows`."""


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class FlatPage:
    """A flat page, and where it lies in the photo."""

    photo: Size
    """Size of the photo after its EXIF rotation."""
    corners: list[tuple[float, float] | None]
    """Corners of the sheet in the photo, clockwise from the top left of the flat page; null: not seen."""
    orientation: Orientation
    width: int
    height: int
    mesh: Mesh


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class FoundCell:
    """What was found of a cell before a person corrected it."""

    text: str
    confidence: float


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class FoundClass:
    """The class that was found before a person corrected it; null: none, with the probability that it is
    none."""

    class_: str | None
    probability: float


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class FoundZone:
    """What was found of a zone before a person corrected it."""

    label: str | None
    confidence: float
    text: str


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class ItemCell:
    """One cell of a table."""

    box: tuple[float, float, float, float]
    """x0, y0, x1, y1 in pixels of the page."""
    text: str
    """A line for each printed one."""
    value: str | None = None
    """The text normalized by the type of its column, as in `fields`; null: see `problem`."""
    currency: str | None = None
    """Currency of an amount (ISO 4217), if it is known."""
    problem: Literal["no-value", "several-values", "ambiguous"] | None = None
    """As in `fields`."""
    confidence: float
    """Probability that the class, the row and the column of the cell and its text are right."""
    found: FoundCell | None = None
    """What was found, where feedback has corrected it; absent where there is no difference."""


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class ItemTable:
    """A table whose columns the settings of the class name (`items`)."""

    columns: list[str]
    """Labels of the columns that were found, in the order of the settings."""
    types: list[Literal["text", "date", "amount", "integer", "email", "phone", "postal-code", "pattern"]]
    """Types of their values, by the settings of the class."""
    headers: list[str | None]
    """What is printed above each column; null: nothing is."""
    box: tuple[float, float, float, float]
    """x0, y0, x1, y1 in pixels of the page, with the header."""
    rows: list[list[ItemCell | None]]
    """From the top down, a cell or null for each column. A page can go on with the table of the page
    before."""
    checks: TableChecks | None = None


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class JobDelivery:
    """One attempt to send a callback."""

    at: str
    status: int | None
    """HTTP status of the answer; null: there was none."""
    failure: str | None
    """What went wrong; null: it was delivered."""
    seconds: float
    """How long it took."""


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class JobLinks:
    """Paths of a job."""

    result: str
    """The response of the work; 409 before its end."""
    events: str
    """Server-sent events: the state whenever it changes."""


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class JobStatus:
    """State of a job."""

    id: str
    """Random. The id, together with the API key, gives access to the result."""
    state: Literal["queued", "running", "succeeded", "failed", "cancelled"]
    """The last three are final."""
    stage: str | None
    """Current stage of the work, spelled as in `timings_ms`; `started` until the work reports one."""
    progress: float
    """Share of the work that is done; it never decreases."""
    attempts: int
    """How often a worker has started it; twice if the first worker ended before the work was done."""
    created: str
    started: str | None
    """When a worker started it, the last time."""
    ended: str | None
    problem: Problem | None
    """Why it failed or was cancelled; /jobs/{id}/result responds with the same problem."""
    links: JobLinks
    """Paths of the job, its result and its events."""
    poll_after_s: int | None
    """Ask for the state again after this many seconds; null: the job has ended."""
    callback_url: str | None
    """Where the state is sent at the job's end."""
    deliveries: list[JobDelivery]
    """Attempts to send it; a failed one is repeated up to 5 times."""


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class KeptImage:
    """The picture of the page, a JPEG file, which GET /layout/results/{id}/image returns. It shows the whole
    page of the result, perhaps with fewer pixels."""

    width: int
    height: int
    bytes: int


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class LabelField:
    """The text of all zones of one label."""

    label: str
    text: str
    """The texts of its zones in reading order, one below the other."""
    type: Literal["text", "date", "amount", "integer", "email", "phone", "postal-code", "pattern"] = "text"
    """By the settings of the class."""
    value: str | None = None
    """The text normalized by its type: a date as YYYY-MM-DD, an amount with a decimal point, a phone number
    as E.164, a text in one line; null: see `problem`."""
    currency: str | None = None
    """Currency of an amount (ISO 4217), if it is known."""
    problem: Literal["no-value", "several-values", "ambiguous"] | None = None
    """no-value: the text has no value of this type. several-values: it has different ones. ambiguous: a
    numeric date is one day by one order and another by the other (set `order`)."""
    confidence: float
    """Probability that the class, the labels of all its zones and the text of the value are right."""
    zones: list[str]
    """Ids of its zones."""


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class LabelledZone:
    """One region of the page; null where a property was not measured."""

    id: str
    box: tuple[float, float, float, float]
    """x0, y0, x1, y1 in pixels of the page."""
    label: str | None
    """null: the zone has no label of the model, or there is no model."""
    confidence: float
    """Probability of the label, given the class; 1 where a person has verified it."""
    found: FoundZone | None = None
    """What was found, where feedback has corrected it; absent where there is no difference."""
    group: str | None
    """Label of the model node that the zone is grouped with."""
    order: int
    """Place in reading order, from 0."""
    kind: Literal["text", "figure", "rule", "noise"]
    lines: int | None
    font_size: float | None
    """Em, pixels."""
    font_class: Literal["small", "normal", "large"] | None
    """Relative to the rest of the page."""
    line_spacing: float | None
    """Pixels from baseline to baseline."""
    weight: float | None
    """Stroke width as a share of the font size."""
    alignment: Literal["left", "right", "centre", "justified"] | None
    appearance: Appearance | None = None
    """Of the ink of the zone."""
    text: str
    text_confidence: float | None = None
    """Mean confidence of the words by their length; null: not read; 1 where a person gave the text."""
    words: list[ReadWord] | None = None
    """The words of the zone, in their order; null: not requested."""
    content: dict[str, float]
    """Content features of the zone, each with a confidence 0-1."""


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class LayoutResult:
    """Class of a document and labels of its zones. `class` is null when no model is stored, and when none of
    the compared models fits the page. In the second case `classes` and `unknown_probability` describe the
    comparison, and the zones have the labels of the best model. After feedback class, labels, texts, fields
    and decision are what the person verified."""

    id: str
    """Id of the result, as in /layout/results/{id}."""
    file_name: str | None = None
    """Name of the uploaded image, of a document of the first one, without folders; null: no image came, or
    none with a name."""
    width: float
    """Pixels; an integer unless the zones were uploaded."""
    height: float
    class_: DocumentClass | None
    found: FoundClass | None = None
    """What was found, where feedback has corrected it; absent where there is no difference."""
    classes: list[DocumentClass]
    """All compared classes, most probable first."""
    unknown_probability: float
    """Probability that the page is of none of these classes; the sum with `classes` is 1."""
    zones: list[LabelledZone]
    fields: list[LabelField] = dataclasses.field(default_factory=list)
    """The text and the value of every label, in reading order; labels without a text are left out."""
    tables: list[ItemTable] = dataclasses.field(default_factory=list)
    """Tables of items, from the top down, where the settings of the class name columns (`items`). A person's
    other class leaves none."""
    match: MatchReport | None
    part: Literal["first", "continuation"] | None = None
    """Part of the document; null: `class` is null, or the page is blank. The first of several pages is
    `first`; for a single page its model decides."""
    document_class: str | None = None
    """Class of the document of this page: `class.name`, or the class that this model continues."""
    language: str | None = None
    """The language in which OCR read the page, as Tesseract names it; null: not read."""
    page: FlatPage | None = None
    """With rectify=true: the flat page in whose pixels the zones are, and where it lies in the photo."""
    orientation: Orientation | None = None
    """How the image was turned, since it read so; places are those in the turned image. null: it was not
    looked for (zones were sent, nothing was read, or `page` has it)."""
    image: KeptImage | None = None
    """The kept picture of the page; null: none is kept."""
    decision: Decision | None = None
    """Whether the labels may be used without a person; null: no model was compared."""
    warnings: list[Warning]
    timings_ms: dict[str, float]


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class MatchReport:
    """The match of the page with the model that gives its zones their labels."""

    cost: float
    node_cost: float
    edge_cost: float
    count_cost: float
    optimal: bool
    """Proved to be the least cost."""
    gap: float
    """Upper bound of the cost above the least cost; 0 when optimal."""
    backbone: dict[str, str]
    """For each label of the model the zone that fits it best."""
    explanation: list[CostTerm] | None
    """Terms of the cost, largest first, at most a thousand; null: not requested."""


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class Mesh:
    """`source[r][c]` is the photo point shown at output pixel (c (width-1)/(columns-1), r
    (height-1)/(rows-1))."""

    rows: int
    columns: int
    source: list[list[tuple[float, float]]]


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class Orientation:
    """Rotation and mirroring that turned the flat view upright."""

    rotation_deg: Literal[0, 90, 180, 270]
    """Clockwise turn, after the mirroring if any, of the page whose lines were made level; what made them
    level is not in it."""
    mirrored: bool
    confidence: float | None
    """null: no text was read."""
    photo_rotation_deg: float | None = None
    """Clockwise turn of the flat page against the photo (of a mirrored page: the mirrored photo), all in all;
    null for a mosaic."""


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class PlainAdvice:
    """What to do better in the next photo."""

    code: str
    """`show-all-text`, `come-closer`, `hold-still`, `focus-evenly`, `flatten-sheet`, `more-light`, `avoid-
    glare` or `avoid-shadow`."""
    detail: str
    """A sentence for the person who takes the photo."""


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class PlainCamera:
    """The camera, known or estimated."""

    focal_length_px: float | None = None
    field_of_view_deg: float | None = None
    """Along the diagonal."""
    source: Literal["estimated", "exif", "given", "assumed", "remembered"]
    """Seen in this page, from EXIF, from the request, of a typical camera, or as earlier photos of this
    camera showed it."""
    name: str | None = None
    """Name of the camera by the request or by EXIF; its focal length is remembered."""
    page_focal_length_px: float | None = None
    """Focal length that this page alone shows; null: it does not show it clearly."""
    page_focal_deviation: float | None = None
    """Standard deviation of the logarithm of `page_focal_length_px`."""
    principal_point: Point | None = None
    """Photo pixels."""
    principal_point_source: Literal["centre", "estimated"]
    """The photo's centre, or, for a cropped photo, estimated from the page."""


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class PlainCreasedSheet:
    """A creased page as a mesh with a regular grid of nodes on the flat sheet."""

    type: Literal["mesh"] = "mesh"
    rows: int
    """Rows of nodes."""
    columns: int
    points: list[list[Point]]
    """Photo point of every node."""
    normals: list[list[Vector]]
    """Unit normal of every cell, camera frame."""


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class PlainEvidence:
    """Evidence for the decision between planar and curved, and for the shape."""

    major_convergence: float | None = None
    """S3/S1 of the text lines' flow; null: too few samples."""
    minor_convergence: float | None = None
    """S3/S1 of the strokes' flow; null: too few samples."""
    text_area_fraction: float
    """Share of the photo that is text."""
    source: list[Literal["text", "outline", "rules", "photo"]]
    """Sources of the shape: text, the sheet's edges, straight lines of print other than text; `photo`: the
    photo is the flat page already (a scan, a page of a PDF, a page that an app has cropped)."""
    outline_confidence: float | None = None
    """Confidence of the sheet's edges; null: none were found."""
    sides_seen: int
    """Number of sides of the sheet with a visible edge."""
    print_kept: float | None = None
    """Share of the characters on the sheet that the view shows with their whole box; null: no text."""
    flatness_error_percent: float | None = None
    """Error of the mesh to expect (RMS after the best similarity, percent of the page's width), by what the
    view shows of itself; null where it shows nothing, and in previews."""


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class PlainFailedPage:
    """A page that could not be flattened; the others are not lost."""

    state: Literal["failed"]
    problem: PlainProblem


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class PlainMesh:
    """`source[r][c]` is the photo point shown at output pixel (c (width-1)/(columns-1), r
    (height-1)/(rows-1))."""

    rows: int
    columns: int
    source: list[list[Point]]


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class PlainMosaicResult:
    """The whole page, and the evidence for its composition."""

    width: int
    height: int
    base: int
    """Index of the photo where the composition started."""
    orientation: PlainOrientation
    patches: list[PlainPatch]
    """One for each photo, in the order of the upload."""
    pairs: list[PlainPair]
    surface: PlainSheetSurface | None = None
    """The bent sheet that all photos of the page show; null: it is flat, or each photo was flattened by
    itself."""
    unplaced: list[int]
    """Photos that could not be placed; `warnings` say why."""
    text: PlainReadText | None = None
    """The text, if it was asked for; its words have no places in the photos."""
    warnings: list[PlainWarning]
    timings_ms: dict[str, float]
    image: str | None = None
    """The image in base64, if `embed` was set."""
    image_media_type: str | None = None
    """Media type of `image`; null without it."""
    page_id: str | None = None
    """Id of the kept page, as in /pages/{id}; null: the page was not kept."""


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class PlainOrientation:
    """Rotation and mirroring that turned the flat view upright."""

    rotation_deg: Literal[0, 90, 180, 270]
    """Clockwise turn, after the mirroring if any, of the page whose lines were made level; what made them
    level is not in it."""
    mirrored: bool
    confidence: float | None = None
    """null: no text was read."""
    photo_rotation_deg: float | None = None
    """Clockwise turn of the flat page against the photo (of a mirrored page: the mirrored photo), all in all;
    null for a mosaic."""


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class PlainPageSize:
    """Size of the sheet in millimetres; null for what is not known, and `reason` says why."""

    width_mm: float | None = None
    height_mm: float | None = None
    dpi: float | None = None
    """Pixels of the flat view per inch of the sheet."""
    paper: str | None = None
    """Name of the format, or the size as it was sent."""
    source: Literal["outline", "given", "file"] | None = None
    """The sheet's proportions, the request, or the resolution of a file that is the page itself; null: the
    size is not known."""
    reason: str
    aspect: float | None = None
    """Width over height of the sheet, if its four corners are seen."""
    aspect_deviation: float | None = None
    """Standard deviation of the aspect's logarithm."""
    stretch: float | None = None
    """Factor by which the view's width over its height was changed to have the proportions of the size that
    the request names; null: it was not fitted."""


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class PlainPageWord:
    """One word that was read."""

    text: str
    confidence: float
    box: Box
    """x0, y0, x1, y1 in pixels of the flat page."""
    photo: list[Point] | None = None
    """Corners of the word in the photo, clockwise from the top left of the flat page; null: the word is of no
    single photo."""
    line: int
    """Number of the text line, from 0, in reading order."""


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class PlainPagesResult:
    """The flat views of all pages: in the order of the upload, and of one photo left before right."""

    pages: list[PlainRectifyResult | PlainFailedPage]
    warnings: list[PlainWarning]
    """About all pages together; each page also has its own."""
    timings_ms: dict[str, float]
    """Stages of the whole work; each page also has its own."""


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class PlainPair:
    """Two overlapping photos, `a` < `b`, and the evidence for their overlap (4.3)."""

    a: int
    b: int
    matches: int
    """Candidate matches of features."""
    votes: int
    """Matches in the largest group of one scale and displacement."""
    runner_up_votes: int
    """Matches in the second largest group."""
    overlap_fraction: float
    """Share of the smaller photo's view."""
    residual_px: float
    """RMS distance of block matches, pixels of the mosaic."""


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class PlainPatch:
    """Contribution of one photo to the page."""

    placed: bool
    mesh: PlainPatchMesh | None = None
    """null: the photo is not placed; then all further fields are null too."""
    scale: float | None = None
    """Pixels of the mosaic per pixel of the photo, at its centre."""
    sharpness: float | None = None
    """Sharpness of its text relative to the sharpest photo."""
    covered_fraction: float | None = None
    """Share of its part of the page that glare, a shadow or a finger hides, and that other photos show."""
    camera: PlainSheetCamera | None = None
    """Its camera, if the page has a `surface`."""


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class PlainPatchMesh:
    """`target[r][c]` is the mosaic's point of photo pixel (c (width-1)/(columns-1), r (height-1)/(rows-1)).
    Photo pixels outside the page get the point of the nearest node on the page."""

    rows: int
    columns: int
    target: list[list[Point]]


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class PlainPlane:
    """A flat page."""

    type: Literal["plane"] = "plane"
    normal: Vector | None = None
    """Unit, camera frame: x right, y down, z forward."""


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class PlainProblem:
    """RFC 9457 problem details, with a stable `code` and the `request_id`."""

    type: str
    """RFC 9457: the status says all about the kind of problem."""
    title: str
    """The status in words."""
    status: int
    """The HTTP status."""
    code: str
    """Stable name of the problem, for programs."""
    detail: str
    """What happened and what to do, for people."""
    field: str | None = None
    """The request field concerned, if any."""
    request_id: str
    """Also in the X-Request-ID header and in the server's log."""


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class PlainQuality:
    """How well the text of a photo can be read."""

    text_height_px: PlainTextHeight
    blur_px: float
    """Standard deviation of the blur of edges."""
    contrast: float
    """Of print against the paper next to it."""
    cut_off_fraction: float
    """Share of the letters at the photo's border, or seen at more than 75 degrees."""
    glare_fraction: float
    """Share of the text's area that is glare."""
    shadow_fraction: float
    """Share of it that is shadow without detail."""
    line_tilt_deg: float
    """Mean angle of the text lines to the rows of the flat page: creased paper leaves some."""
    predicted_character_error: float
    """Share of the characters that OCR will probably not read right."""
    predicted_from: Literal["photo", "reading"]
    """What the error is predicted from: figures of the photo, or confidences of its words (text=true)."""
    advice: list[PlainAdvice]
    """The most important first; empty for a photo that reads well."""


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class PlainReadText:
    """The text of the page, in reading order."""

    language: str
    """Language that was read, as Tesseract names it."""
    confidence: float | None = None
    """Mean confidence of the words by their length; null: no word was read."""
    words: list[PlainPageWord]


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class PlainRectifyResult:
    """The frontal flat view of one photo, and the evidence for it."""

    state: Literal["flat"]
    photo: PlainSize
    """Size of the photo after its EXIF rotation."""
    corners: list[Point] | None = None
    """Corners of the sheet in the photo, clockwise from the top left of the flat page; null: not seen."""
    orientation: PlainOrientation
    width: int
    height: int
    mesh: PlainMesh
    kind: Literal["planar", "curved"]
    evidence: PlainEvidence
    camera: PlainCamera
    surface: PlainCreasedSheet | PlainPlane | PlainStrips
    page: PlainPageSize | None = None
    """True size of the sheet."""
    quality: PlainQuality | None = None
    """How well the photo can be read; null for a page without text."""
    text: PlainReadText | None = None
    """The text, if it was asked for."""
    warnings: list[PlainWarning]
    timings_ms: dict[str, float]
    image: str | None = None
    """The image in base64, if `embed` was set."""
    image_media_type: str | None = None
    """Media type of `image`; null without it."""
    page_id: str | None = None
    """Id of the kept page, as in /pages/{id}; null: its photo was not kept."""


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class PlainRuling:
    """Straight line on a curved page."""

    point: Point
    angle_deg: float
    vanishing_point: Point | None = None


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class PlainSheetCamera:
    """The camera of a photo of one bent sheet. Lengths in space are in widths of the sheet. A point X of the
    sheet is at (x, y, z) = `rotation` X + `translation` in the camera's frame (x right, y down, z forward),
    and seen at `principal_point` + `focal_length_px` (x / z, y / z)."""

    focal_length_px: float
    principal_point: Point
    """Photo pixels."""
    rotation: list[Vector]
    """Rows of the rotation matrix."""
    translation: Vector


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class PlainSheetSurface:
    """The bent sheet that all photos of the page show, as a mesh with a regular grid of nodes on the flat
    sheet."""

    kind: Literal["smooth", "creased"]
    reference: int
    """Index of the photo in whose camera frame the nodes are."""
    fitted: bool
    """true: the sheet was fitted to all photos; false: it is that of the reference photo alone, which the
    others confirm."""
    residual_text_heights: float
    """Median distance between where the photo that fits worst shows points of the sheet, and where its camera
    should see them."""
    rows: int
    columns: int
    nodes: list[list[Vector]]
    """Rows of nodes in space, in widths of the sheet."""


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class PlainSize:
    """Size in pixels."""

    width: int
    height: int


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class PlainStrips:
    """A curved page as planar strips between rulings."""

    type: Literal["strips"] = "strips"
    normals: list[Vector]
    rulings: list[PlainRuling]


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class PlainTextHeight:
    """Height of the letters in photo pixels."""

    min: float
    """Of the smallest or farthest print on the page."""
    median: float


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class PlainWarning:
    """Remark on the quality of the result."""

    code: str
    detail: str


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class Point:
    """A point, pixels."""

    x: float
    y: float


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class Problem:
    """RFC 9457 problem details, with a stable `code` and the `request_id`."""

    type: str
    """RFC 9457: the status says all about the kind of problem."""
    title: str
    """The status in words."""
    status: int
    """The HTTP status."""
    code: str
    """Stable name of the problem, for programs."""
    detail: str
    """What happened and what to do, for people."""
    field: str | None = None
    """The request field concerned, if any."""
    request_id: str
    """Also in the X-Request-ID header and in the server's log."""


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class ReadWord:
    """A word that OCR read."""

    text: str
    box: tuple[float, float, float, float]
    """x0, y0, x1, y1 in pixels of the page."""
    confidence: float
    line: int
    """Line of the zone's `text`, from 0."""


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class Size:
    """Size in pixels."""

    width: int
    height: int


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class StackResult:
    """The documents of a stack of pages, in their order; each is a result of its own."""

    documents: list[DocumentResult]


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class TableChecks:
    """What the numbers of a table say of each other, where samples show what they should; null: not
    checked."""

    products: Literal["fit", "differ"] | None = None
    """Whether one column is the product of two others, such as quantity and price."""
    unlike_rows: list[int] = dataclasses.field(default_factory=list)
    """Rows, from 0, in which it is not; their cells are less sure."""
    sum: Literal["fits", "differs"] | None = None
    """Whether the amounts of all rows of the document add up to an amount printed below, before or after
    taxes."""


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class UploadState:
    """How far an upload in pieces has come."""

    id: str
    """What a form takes as `upload`, in place of the file."""
    name: str | None
    """Name of the file."""
    length: int
    """Number of bytes of the whole file."""
    offset: int
    """Bytes that have come; the next piece begins here."""
    created: str
    expires: str
    """When it is deleted."""


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class Vector:
    """A direction in space."""

    x: float
    y: float
    z: float


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class Warning:
    """Remark on the quality of the result."""

    code: str
    detail: str


class RectifyOptions(TypedDict, total=False):
    """Options of RectifyForm."""

    kind: Literal["auto", "planar", "curved"] | None
    """planar or curved: skip the decision between both."""
    upright: bool | None
    """Rotate (and mirror) the result so that the text is upright; false: only make the text lines
    horizontal."""
    focal_length_px: float | None
    """Known focal length; default: from EXIF if present, else estimated."""
    region: str | list[Any] | None
    """JSON [[x, y], ...] of 3 to 200 points, pixels of the photo after its EXIF rotation: polygon around the
    page's text, to guide text identification. For one photo only."""
    corners: str | list[Any] | None
    """JSON [[x, y], [x, y], [x, y], [x, y]]: the sheet's corners in the photo, pixels after its EXIF
    rotation, clockwise from the page's top left. They are exact and not moved; the sides between them are
    sought. Several pages: a list with an entry for each, null where they are to be found."""
    rotate: str | int | None
    """Clockwise turn of the flat page in degrees, in place of the one that `upright` finds (which
    `orientation.rotation_deg` says), or with `corners` of the page that begins at the first of them: auto, 0,
    90, 180 or 270. Several pages: an entry for each, as auto,90,auto, or one for all."""
    margin: float | None
    """What is shown around the cut, percent of the page's width."""
    illumination: Literal["keep", "normalize", "gray", "bw"] | None
    """normalize: remove uneven light and shadow: dark text on white paper; gray: the same in gray; bw: in
    black and white, Group 4 in PDFs and TIFF files."""
    crop: Literal["sheet", "text", "photo"] | None
    """Content of the view: the sheet cut at its edges, the text with margins, or all of the photo near the
    text."""
    pages: Literal["main", "both"] | None
    """For an open book: the main page of the photo, or both pages, left before right. With `both` the
    response is a list of pages, even for one page."""
    paper: str | None
    """True size of the sheet: auto (a format where the sheet's corners are seen and only one has its
    proportions), none, a3, a4, a5, letter, legal, or width x height in millimetres (210x297)."""
    on_no_text: Literal["refuse", "keep"] | None
    """keep: pass a photo through as it is when neither text nor an outline shows its page's shape; refuse:
    answer `no-text`. Default: refuse for one page, keep for several."""
    preview: bool | None
    """With format=json, for live use: mesh, outline, quality and advice from a reduced photo. Nothing is
    drawn, read or turned upright."""
    keep_photo: bool | None
    """Keep the photo with what later answers need: the response has `page_id` (header `Document-Page-Id`),
    see /pages. Default: the setting KEEP_PHOTOS (false, unless the operator has changed it)."""
    camera: str | None
    """Name of the camera, any token: the focal length that its pages show is remembered, and used where a
    page does not show it. Default: make, model and size of the photo by EXIF."""
    text: bool | None
    """Read the page: `text` in JSON has the words with their places, and a PDF gets an invisible text layer,
    so that it can be searched. The formats hocr, alto, txt and markdown imply it."""
    language: str | None
    """Language of the text as Tesseract names it, several joined by `+`: `eng`, `deu`, `eng+fra`. Default:
    the first of OCR_LANGUAGES."""
    quality: int | None
    """1-100, for lossy formats; default 90."""
    embed: bool | None
    """With JSON: include the image as base64 in `image`."""
    embed_format: Literal["jpeg", "png", "webp"] | None
    """With JSON: the format of the image in `image`, which is then included (as by embed=true). Default: the
    photo's own format."""
    max_width: int | None
    """Largest size of the picture in pixels, for previews: it is reduced, never enlarged, and keeps its
    proportions. Sizes and meshes in the response are those of the smaller picture."""
    max_height: int | None
    """Largest size of the picture in pixels, for previews: it is reduced, never enlarged, and keeps its
    proportions. Sizes and meshes in the response are those of the smaller picture."""
    pdf_version: Literal["1.7", "a-2b"] | None
    """Version of a PDF: 1.7, or a-2b for archives (PDF/A-2b, ISO 19005-2)."""
    title: str | None
    """Title of a PDF or hOCR file; default: the file name of the (first) photo."""
    archive: Literal["images", "json", "both"] | None
    """What an archive (format=zip) has of every page: its image, its JSON description (page-01.json; the
    problem of a page that failed), or both."""
    callback_url: str | None
    """With `Prefer: respond-async`: where the service sends the job's state at its end, signed as Standard
    Webhooks says. The host must be one of CALLBACK_HOSTS."""


class MosaicOptions(TypedDict, total=False):
    """Options of MosaicForm."""

    rectify: bool | None
    """false: the photos are already flat (scans) and differ by shift, scale and a small rotation only."""
    base: str | int | None
    """Index, from 0, of a photo. If the photos form parts that do not connect, the response shows the part
    with this photo; auto: the largest part."""
    composition: Literal["selective", "average"] | None
    """selective: each word from the sharpest photo; else a feathered average, for comparison."""
    upright: bool | None
    """Rotate (and mirror) the result so that the text is upright; false: only make the text lines
    horizontal."""
    rotate: str | int | None
    """Clockwise turn of the page in degrees, in place of the one that `upright` finds: auto, 0, 90, 180 or
    270."""
    illumination: Literal["keep", "normalize", "gray", "bw"] | None
    """normalize: remove uneven light and shadow: dark text on white paper; gray: the same in gray; bw: in
    black and white, Group 4 in PDFs and TIFF files."""
    keep_photo: bool | None
    """Keep the joined page for later answers: the response has `page_id` (header `Document-Page-Id`), see
    /pages. The photos are not kept."""
    camera: str | None
    """Name of the camera, any token: the focal length that its pages show is remembered, and used where a
    page does not show it. Default: make, model and size of the photo by EXIF."""
    text: bool | None
    """Read the page: `text` in JSON has the words with their places, and a PDF gets an invisible text layer,
    so that it can be searched. The formats hocr, alto, txt and markdown imply it."""
    language: str | None
    """Language of the text as Tesseract names it, several joined by `+`: `eng`, `deu`, `eng+fra`. Default:
    the first of OCR_LANGUAGES."""
    quality: int | None
    """1-100, for lossy formats; default 90."""
    embed: bool | None
    """With JSON: include the image as base64 in `image`."""
    embed_format: Literal["jpeg", "png", "webp"] | None
    """With JSON: the format of the image in `image`, which is then included (as by embed=true). Default: the
    photo's own format."""
    max_width: int | None
    """Largest size of the picture in pixels, for previews: it is reduced, never enlarged, and keeps its
    proportions. Sizes and meshes in the response are those of the smaller picture."""
    max_height: int | None
    """Largest size of the picture in pixels, for previews: it is reduced, never enlarged, and keeps its
    proportions. Sizes and meshes in the response are those of the smaller picture."""
    pdf_version: Literal["1.7", "a-2b"] | None
    """Version of a PDF: 1.7, or a-2b for archives (PDF/A-2b, ISO 19005-2)."""
    title: str | None
    """Title of a PDF or hOCR file; default: the file name of the (first) photo."""
    callback_url: str | None
    """With `Prefer: respond-async`: where the service sends the job's state at its end, signed as Standard
    Webhooks says. The host must be one of CALLBACK_HOSTS."""


class LayoutOptions(TypedDict, total=False):
    """Options of LayoutForm."""

    zones: str | dict[str, Any] | None
    """JSON `{"width", "height", "zones": [{"id", "box": [x0, y0, x1, y1], "font_size"?, "lines"?, "text"?,
    "kind"?}]}`, as a field or as a file: zones from another segmenter. With `image`, they are in pixels of
    the image."""
    rectify: bool | None
    """Rectify the photo first; zones are then in pixels of the flat page."""
    ocr: Literal["auto", "off"] | None
    """auto: read the page if an OCR engine is installed."""
    language: str | None
    """Language of the text as Tesseract names it, several joined by `+`: `eng`, `deu`, `eng+fra`. Default:
    the first of OCR_LANGUAGES."""
    models: str | None
    """The models to compare, separated by commas; default: all."""
    keep_image: bool | None
    """Keep the picture of the page with the result, for GET /layout/results/{id}/image. Default: by the
    setting KEEP_IMAGES (false, unless the operator has changed it)."""
    page: int | None
    """Number, from 1, of the only page to recognize."""
    split: bool | None
    """The pages are a stack of documents: find where each begins. The answer is JSON, a `StackResult`."""
    explain: bool | None
    """With JSON: list the terms of the cost, largest first, in `match.explanation`."""
    words: bool | None
    """Add the words of every zone, each with its box and OCR confidence, to JSON, PAGE-XML and ALTO."""
    callback_url: str | None
    """With `Prefer: respond-async`: where the service sends the job's state at its end, signed as Standard
    Webhooks says. The host must be one of CALLBACK_HOSTS."""
