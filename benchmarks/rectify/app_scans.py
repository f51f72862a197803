"""Pages that a phone's app has cropped already, against flatbed scans of the same sheets.

python -m benchmarks app_scans [--data FOLDER] [--update-baseline]

Residual: distance of the print from the scan's after the best affine map (RMS, percent of the sheet's width), of the
photo as it is and of our view. Paper lost: share of the photo's paper that the view does not show. Desk left: share of
the view that shows desk. Two sheets (`SET_ASIDE`) were not looked at while the code was written; both groups have means
of their own.
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from scipy.interpolate import LinearNDInterpolator

from benchmarks.common.baseline import Figures, Metric, judge
from benchmarks.common.places import BASELINE, data_folder
from benchmarks.common.scan_matches import match_scan
from services.arrays import Floats, Mask, Points, RgbImage
from services.contract.images import DocumentLimits, Encoding
from services.contract.rectify import RectifyParameters
from services.errors import DocumentError
from services.operations.rectify_documents import rectify_uploads

SET_ASIDE = ("type03", "type11-sample5")
METRICS = {
    "residual_percent": Metric(0.02),
    "paper_lost_percent": Metric(0.1),
    "desk_left_percent": Metric(0.2),
    "named_wrongly": Metric(0.0),
}
"""Figures of a photo that are compared with the committed ones."""
_SHEET_PX = 2480
"""Width of a sheet of A4 in the scans, which have 300 dpi."""
_DARK = 0.55
"""Desks are darker than this share of the paper; in these photos all are."""
_PRINT_PX = 7
"""What is narrower is print, in a photo of `_LONG_SIDE_PX`."""
_LONG_SIDE_PX = 1000


def desk_of(photo: RgbImage) -> Mask:
    """Desk in `photo` (H, W, 3), at a long side of `_LONG_SIDE_PX`: dark, wider than print, joined with the frame."""
    factor = _LONG_SIDE_PX / max(photo.shape[:2])
    gray = cv2.cvtColor(photo, cv2.COLOR_RGB2GRAY)
    gray = cv2.resize(gray, None, fx=factor, fy=factor, interpolation=cv2.INTER_AREA)
    dark = (gray < _DARK * np.percentile(gray, 75)).astype(np.uint8)
    framed = cv2.copyMakeBorder(dark, 20, 20, 20, 20, cv2.BORDER_REPLICATE)
    wide = cv2.morphologyEx(framed, cv2.MORPH_CLOSE, np.ones((5, 5), np.uint8))
    wide = cv2.morphologyEx(wide, cv2.MORPH_OPEN, np.ones((_PRINT_PX, _PRINT_PX), np.uint8))[20:-20, 20:-20]
    _, labels = cv2.connectedComponents(wide)
    rim = np.concatenate([labels[0], labels[-1], labels[:, 0], labels[:, -1]])
    return np.asarray(np.isin(labels, np.unique(rim[rim > 0])))


def affine_residual(source: Points, target: Points) -> float:
    """RMS distance, in the target's unit, that the best affine map leaves."""
    terms = np.column_stack([source, np.ones(len(source))])
    rest = target - terms @ np.linalg.lstsq(terms, target, rcond=None)[0]
    return float(np.sqrt((rest**2).sum(axis=1).mean()))


def view_places(mesh: Floats, width: int, height: int, photo: Points) -> Points:
    """Pixels (N, 2) of the view that show points (N, 2) of the photo; NaN where it does not show them."""
    rows, columns = mesh.shape[:2]
    x, y = np.meshgrid(np.linspace(0, width - 1, columns), np.linspace(0, height - 1, rows))
    found = LinearNDInterpolator(mesh.reshape(-1, 2), np.column_stack([x.ravel(), y.ravel()]))
    return np.asarray(found(photo), np.float64)


def coverage(mesh: Floats, view: RgbImage, photo: RgbImage, desk: Mask) -> tuple[float, float]:
    """Paper lost and desk left, 0-1."""
    factor = _LONG_SIDE_PX / max(photo.shape[:2])
    border = np.concatenate([mesh[0], mesh[1:, -1], mesh[-1, -2::-1], mesh[-2:0:-1, 0]])
    shown = np.zeros(desk.shape, np.uint8)
    cv2.fillPoly(shown, [np.round(((border + 0.5) * factor - 0.5) * 16).astype(np.int32)], 1, shift=4)
    lost = float(((shown == 0) & ~desk).sum() / max((~desk).sum(), 1))
    fine = cv2.resize(mesh.astype(np.float32), (400, 560), interpolation=cv2.INTER_LINEAR)
    at = np.round((fine + 0.5) * factor - 0.5).astype(int)
    inside = ((at >= 0) & (at < [desk.shape[1], desk.shape[0]])).all(axis=2)
    at = np.clip(at, 0, [desk.shape[1] - 1, desk.shape[0] - 1])
    gray = cv2.cvtColor(cv2.resize(view, (400, 560), interpolation=cv2.INTER_AREA), cv2.COLOR_RGB2GRAY)
    drawn = gray < _DARK * np.percentile(gray, 75)
    return lost, float((inside & drawn & desk[at[..., 1], at[..., 0]]).mean())


def measure(file: Path, scan: RgbImage) -> tuple[dict[str, float], str]:
    """Figures of one photo, and a remark."""
    photo = np.asarray(cv2.imread(str(file))[..., ::-1], np.uint8)
    seen, flat = match_scan(photo, scan)
    own = 100 * affine_residual(seen, flat) / _SHEET_PX
    reply = rectify_uploads(
        [file.read_bytes()], RectifyParameters(upright=False), Encoding("png"), DocumentLimits()
    )
    document = reply.answer.model_dump(mode="json")
    view = np.asarray(cv2.imdecode(np.frombuffer(reply.body, np.uint8), cv2.IMREAD_COLOR)[..., ::-1])
    mesh = np.array(document["mesh"]["source"], np.float64)
    height, width = view.shape[:2]
    places = view_places(mesh, width, height, seen)
    known = np.isfinite(places).all(axis=1)
    lost, left = coverage(mesh, view, photo, desk_of(photo))
    page = document["page"]
    assert isinstance(page, dict)
    figures = {
        "own_percent": own,
        "residual_percent": 100 * affine_residual(places[known], flat[known]) / _SHEET_PX,
        "paper_lost_percent": 100 * lost,
        "desk_left_percent": 100 * left,
        "print_lost_percent": 100 * float((~known).mean()),
        "named_wrongly": float(page["paper"] not in (None, "a4")),
    }
    warnings = [warning["code"] for warning in document["warnings"]]  # type: ignore[attr-defined]
    evidence = document["evidence"]
    assert isinstance(evidence, dict)
    return (
        figures,
        f"{document['kind']} by {'+'.join(evidence['source'])} {page['paper'] or ''} {' '.join(warnings)}",
    )


def main(arguments: Sequence[str]) -> int:
    """Print a line a photo and the means; compare with the committed figures."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks app_scans", description=__doc__)
    parser.add_argument("--data", default=None)
    parser.add_argument("--update-baseline", action="store_true")
    parser.add_argument("--only", default="", help="part of the photos' names")
    parser.add_argument("--no-set-aside", action="store_true", help="leave the set-aside sheets out")
    asked = parser.parse_args(arguments)
    folder = data_folder(asked.data) / "photos_app"
    if not folder.is_dir():
        print(f"No photos at {folder}: nothing was measured.")
        return 0
    figures: Figures = {}
    for file in sorted(folder.glob("*-set*.jpg")):
        sheet = file.stem.rsplit("-set", 1)[0]
        if asked.only not in file.stem or (asked.no_set_aside and sheet in SET_ASIDE):
            continue
        scan = np.asarray(cv2.imread(str(folder / f"{sheet}.scan.jpg"))[..., ::-1], np.uint8)
        try:
            found, remark = measure(file, scan)
        except DocumentError as error:
            print(f"{file.stem:24s} {error.code}")
            continue
        figures[file.stem] = found
        print(
            f"{file.stem:24s} photo {found['own_percent']:.2f} ours {found['residual_percent']:.2f} %  paper lost "
            f"{found['paper_lost_percent']:5.2f} % desk left {found['desk_left_percent']:4.2f} % print lost "
            f"{found['print_lost_percent']:4.1f} %  {remark}",
            flush=True,
        )
    for name, aside in (("built on", False), ("set aside", True)):
        group = [
            case for photo, case in figures.items() if (photo.rsplit("-set", 1)[0] in SET_ASIDE) == aside
        ]
        if group:
            mean = {key: float(np.mean([case[key] for case in group])) for key in group[0]}
            worst = max(case["residual_percent"] - case["own_percent"] for case in group)
            print(
                f"{len(group)} {name}: photo {mean['own_percent']:.3f} %, ours {mean['residual_percent']:.3f} % (worst "
                f"+{worst:.3f}), paper lost {mean['paper_lost_percent']:.2f} % (worst "
                f"{max(case['paper_lost_percent'] for case in group):.2f}), desk left "
                f"{mean['desk_left_percent']:.2f} % (worst {max(case['desk_left_percent'] for case in group):.2f})"
            )
    report, fine = judge(BASELINE / "app_scans.json", figures, METRICS, update=asked.update_baseline)
    print(report)
    return 0 if fine else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
