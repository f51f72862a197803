"""Lines of the text that was analysed, as a view shows them, and what a reader says of them.

The analysis knows where characters are, so that no page needs to be drawn and searched to read one of its lines.
"""

import numpy as np

from services.arrays import GrayImage, Points, Vector
from services.geometry.homographies import translation
from services.geometry.page_frame import Frame, resize_frame
from services.imaging.photo_part import PhotoPart
from services.ocr.engine import OcrEngine
from services.ocr.text_lines import TextLine, cut_line
from services.order_statistics import median
from services.rectify.analysis.page_analysis import PageAnalysis
from services.rectify.view.drawing import draw_gray_view
from services.rectify.view.line_reader import CROP_HEIGHT_PX, LineReader, Way
from services.sheet.tracing.baselines import chain_boxes

LINE_HEIGHT = 1.9
"""Of a line with ascenders and descenders, over the usual size of its characters: most have neither."""
CROP_LENGTH = 18.0
"""Heights of a line that are read, some 30 letters. Of 114 lines of 38 pages 42 read evidently, 45 in crops of 26
heights, which take a third longer; upside down none of 20 letters and more reached 0.6. Scripts that the engine does
not know need the longer ones: this is for evident lines only."""
MARGIN = 0.5
"""Of the line's height, round the part of the view that is drawn for its crop."""


def evident_line(analysis: PageAnalysis, frame: Frame, ocr: OcrEngine) -> float | None:
    """Confidence of a line that reads evidently along the rows of the view, as `LineReader.evident_score`; else None.

    `frame` is the view's.
    """
    strokes = analysis.strokes
    # At the size of the image for strokes, in which words can be read.
    view = resize_frame(frame, strokes.factor)

    def cut(line: TextLine) -> GrayImage:
        return cut_from_view(line, view, strokes)

    # Another line costs less than to draw the page and search it, as the next reading of a clear one would need.
    reader = LineReader(lines_in_view(analysis, view), cut, 0, ocr)
    return reader.evident_score(Way(0, False), is_clear_enough=False)


def lines_in_view(analysis: PageAnalysis, view: Frame) -> list[TextLine]:
    """Lines of the text along the rows of the `view`, in its pixels."""
    characters, half = analysis.characters, 0.5 * analysis.text.components.sizes / analysis.factor
    with np.errstate(all="ignore"):
        centres = view.to_flat(characters)
        below = view.to_flat(characters + half[:, None] * [0.0, 1.0])
        sizes = 2.0 * np.linalg.norm(below - centres, axis=1)
    seen = np.isfinite(centres).all(axis=1) & np.isfinite(sizes)
    centres, sizes = centres[seen], sizes[seen]
    # Squares, since the boxes of letters in a photo that is turned say little of their heights.
    chained = chain_boxes(np.column_stack([centres - sizes[:, None] / 2, sizes, sizes]))
    middles = np.column_stack([chained.left + chained.right, chained.top + chained.bottom]) / 2
    return [_line_of(middles[row], chained.bottom[row] - chained.top[row]) for row in chained.rows]


def _line_of(middles: Points, sizes: Vector) -> TextLine:
    """The line of characters by their `middles` (n, 2) and `sizes` (n,), pixels."""
    size = median(sizes)
    x, y = middles.T
    centre = (x.min() + x.max()) / 2
    slope, _ = np.polyfit(x - centre, y, 1)
    middle = median(y - slope * (x - centre))
    reach = LINE_HEIGHT * size / 2
    box = (float(x.min() - size / 2), middle - reach, float(x.max() + size / 2), middle + reach)
    return TextLine(box, float(slope), 1.0)


def cut_from_view(line: TextLine, view: Frame, strokes: PhotoPart) -> GrayImage:
    """Level crop of a `line` of the `view`, drawn from the part of the photo that holds its `strokes`."""
    margin, length = MARGIN * line.height_px, min(line.width_px, CROP_LENGTH * line.height_px)
    rise = abs(line.slope) * line.width_px / 2
    low = np.floor([line.box[0] - margin, line.box[1] - rise - margin])
    high = np.ceil([line.box[0] + length + margin, line.box[3] + rise + margin])
    width, height = (high - low).astype(int).tolist()
    part = view.through(translation(float(low[0]), float(low[1])), width, height)
    patch = draw_gray_view(strokes.image, strokes.factor, part, strokes.origin)
    x0, y0, x1, y1 = np.array(line.box) - np.tile(low, 2)
    moved = TextLine((float(x0), float(y0), float(x1), float(y1)), line.slope, line.strokes)
    return cut_line(patch, moved, False, CROP_HEIGHT_PX, CROP_LENGTH)
