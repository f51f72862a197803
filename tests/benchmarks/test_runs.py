"""A case and a photo from end to end, with stand-ins for the rectification and the judge."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from benchmarks.common.figures import StripErrors
from benchmarks.common.reading import Reading
from benchmarks.common.scan_distances import ScanDistances
from benchmarks.common.stopwatch import Usage
from benchmarks.rectify import photo_report, photos, simulated
from benchmarks.rectify.cases import EXPERIMENTS, Case, all_cases
from benchmarks.rectify.real_photos import RealPhoto
from benchmarks.rectify.simulated import Bench, Options, run_case
from benchmarks.rectify.subject import FlowErrors, Flows, measure_flows, measure_steps
from benchmarks.rectify.true_map import flatten_by_truth, flatten_in_frame
from services.errors import NoText
from services.rectify.results import CameraEstimate, Evidence, Orientation, RectifyResult
from services.sheet.surfaces import PlaneSurface, StripsSurface
from simulation.flat_page import Page
from simulation.pages import own_pages
from simulation.photo import SimulatedPhoto
from simulation.scenes import BOOK, PLANE, POSES, photograph
from simulation.surfaces import Shape


class Judge:
    """Reads every image as the same text."""

    name = "judge"

    def read(self, image: np.ndarray) -> Reading:
        """See `Reader`."""
        return Reading("Call me Ishmael. Some years ago", 20)


@pytest.fixture(scope="module")
def page() -> Page:
    return own_pages(400, 625)[0]


@pytest.fixture
def bench(tmp_path: Path, page: Page) -> Bench:
    options = Options(tmp_path, (), None, "", None, None, tmp_path / "memory", tmp_path / "pictures")
    bench = Bench(options)
    bench.pages = {page.name: page}
    bench.reader = Judge()
    return bench


def _small_photo(page: Page, shape: Shape = PLANE) -> SimulatedPhoto:
    return photograph(page, POSES[0], 0.0, shape, size=(525, 675))


def _fix_flows(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        simulated,
        "measure_steps",
        lambda image, truth, points, *, curved: (FlowErrors(0.1, 0.2), StripErrors(ruling_2d_deg=0.3)),
    )


def _case(page: Page, experiment: str = "planar") -> Case:
    return all_cases(EXPERIMENTS[experiment], (page.name,), degraded=False)[0]


def _perfect(photo: SimulatedPhoto) -> RectifyResult:
    """What a rectification that knows the truth would answer."""
    truth = photo.truth
    x, y = np.meshgrid(np.linspace(0, truth.page.width - 1, 9), np.linspace(0, truth.page.height - 1, 13))
    mesh = truth.page_to_photo(np.column_stack([x.ravel(), y.ravel()])).reshape(13, 9, 2)
    surface: PlaneSurface | StripsSurface
    if truth.is_planar:
        normal = truth.normals(truth.sheet_to_photo(np.zeros((1, 2))))[0]
        surface = PlaneSurface((float(normal[0]), float(normal[1]), float(normal[2])))
    else:
        edges, middles = (
            np.column_stack([at, 0 * at]) for at in (np.linspace(-1, 1, 41), np.arange(-0.975, 1, 0.05))
        )
        points = truth.sheet_to_photo(edges)
        surface = StripsSurface(
            truth.normals_on_sheet(middles),
            points,
            truth.rulings(points),
            truth.ruling_vanishing_points(points),
        )
    return RectifyResult(
        flatten_by_truth(photo.image, truth),
        "planar" if truth.is_planar else "curved",
        Evidence(0.0, 0.0, 0.5),
        CameraEstimate(truth.focal_length_px, None, "estimated"),
        surface,
        Orientation(0, False, None),
        mesh,
    )


def test_a_perfect_rectification_has_no_errors(
    bench: Bench, page: Page, monkeypatch: pytest.MonkeyPatch
) -> None:
    photo = _small_photo(page)
    monkeypatch.setattr(simulated, "photograph_case", lambda case, page, facing: photo)
    monkeypatch.setattr(simulated, "rectify_photo", lambda image, ocr, exif, corners=None: _perfect(photo))
    _fix_flows(monkeypatch)
    case = _case(page)
    figures = run_case(case, bench)
    assert figures.classified
    assert figures.upright
    assert figures.residual_percent < 1e-6
    assert figures.fov_deg < 1e-6
    assert figures.normal_deg < 1e-4
    assert (figures.major_deg, figures.minor_deg) == (0.1, 0.2)
    assert set(figures.scores) == {"photo", "rectified", "true map", "true map, our frame", "clean page"}
    assert 0 < figures.scores["rectified"].characters < 30
    assert figures.usage["rectify"].peak_mb > 10
    folder = bench.options.pictures / "rectify_planar"
    assert (folder / f"{case.name}.jpg").is_file()
    assert (folder / "pairs" / f"{case.name}.jpg").is_file()


def test_a_perfect_flattening_of_a_bent_page_has_no_errors(
    bench: Bench, page: Page, monkeypatch: pytest.MonkeyPatch
) -> None:
    photo = _small_photo(page, BOOK)
    monkeypatch.setattr(simulated, "photograph_case", lambda case, page, facing: photo)
    monkeypatch.setattr(simulated, "rectify_photo", lambda image, ocr, exif, corners=None: _perfect(photo))
    _fix_flows(monkeypatch)
    case = _case(page, "curved")
    figures = run_case(case, bench)
    assert figures.classified
    assert figures.upright
    assert figures.residual_percent < 1e-6
    assert figures.ruling_2d_deg < 1e-5
    assert figures.ruling_3d_deg < 1e-5
    assert figures.normal_deg < 0.5
    # The best planar view of it is a poor answer, and of the wrong kind.
    flat = replace(_perfect(photo), kind="planar", surface=PlaneSurface((0.0, 0.0, 1.0)))
    monkeypatch.setattr(simulated, "rectify_photo", lambda image, ocr, exif, corners=None: flat)
    worse = run_case(case, bench)
    assert not worse.classified
    assert np.isnan(worse.ruling_2d_deg)
    assert worse.normal_deg > 10


def test_a_refusal_reads_as_nothing(bench: Bench, page: Page, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(image: np.ndarray, ocr: object, exif: object, corners: object) -> RectifyResult:
        raise NoText("blank")

    monkeypatch.setattr(simulated, "photograph_case", lambda case, page, facing: _small_photo(page))
    monkeypatch.setattr(simulated, "rectify_photo", refuse)
    figures = run_case(_case(page), bench)
    assert figures.failure.startswith("no-text")
    assert not figures.classified
    assert figures.scores["rectified"].characters == 0
    assert figures.scores["true map"].characters > 0


def test_the_true_map_gives_the_page_back(page: Page) -> None:
    photo = photograph(page, POSES[0], 0.0, PLANE, size=(1050, 1350))
    flat = flatten_by_truth(photo.image, photo.truth)[..., 0].astype(float)
    light = photo.truth.normals(photo.truth.sheet_to_photo(np.zeros((1, 2))))[0, 2]
    inner = slice(20, -20)
    error = flat[inner, inner] - page.image[inner, inner] * light
    assert np.sqrt(np.mean(error**2)) < 12


def test_the_true_map_in_our_frame_shows_what_we_show(page: Page) -> None:
    photo = photograph(page, POSES[0], 0.0, PLANE, size=(1050, 1350))
    result = _perfect(photo)
    same = flatten_in_frame(photo.image, photo.truth, result)
    assert same is not None
    assert np.abs(same.astype(int) - result.image).max() <= 2
    # A rectification of the wrong shape is shown at its place and size, but in the true shape.
    bent = result.mesh + 8.0 * np.sin(np.linspace(0, 6, 13))[:, None, None]
    wrong = flatten_in_frame(photo.image, photo.truth, replace(result, mesh=bent))
    assert wrong is not None
    assert wrong.shape == result.image.shape
    beside = replace(result, mesh=np.full((3, 3, 2), -90.0))
    assert flatten_in_frame(photo.image, photo.truth, beside) is None


def test_flows_are_compared_with_the_truth(page: Page) -> None:
    truth, turn = _small_photo(page).truth, np.radians(2.0)
    points = truth.text_points(np.random.default_rng(0))
    flows = Flows(
        lambda points: truth.major_flow(points) + turn, lambda points: truth.minor_flow(points) - 2 * turn
    )
    errors = measure_flows(flows, truth, points)
    assert errors.major_deg == pytest.approx(2.0)
    assert errors.minor_deg == pytest.approx(4.0)
    assert np.isnan(measure_flows(replace(flows, minor=None), truth, points).minor_deg)
    assert np.isnan(measure_flows(flows, truth, points[:0]).major_deg)


def test_the_steps_of_a_bent_page_are_measured(page: Page) -> None:
    photo = photograph(page, POSES[0], 0.0, BOOK, size=(1050, 1350))
    points = photo.truth.text_points(np.random.default_rng(0))
    flows, strips = measure_steps(photo.image, photo.truth, points, curved=True)
    # Small print: far from what full-size photos show, but no accident.
    assert flows.major_deg < 3
    assert flows.minor_deg < 3
    assert strips.ruling_2d_deg < 6
    assert strips.normal_deg < 15
    assert strips.fov_deg < 10
    assert strips.first_normal_deg < 40
    flat_flows, none = measure_steps(photo.image, photo.truth, points, curved=False)
    assert flat_flows.major_deg != flows.major_deg
    assert np.isnan(none.ruling_2d_deg)


def test_a_real_photo_is_measured_by_every_method(
    tmp_path: Path, page: Page, monkeypatch: pytest.MonkeyPatch
) -> None:
    photo = _small_photo(page)
    path, scan = tmp_path / "leaf.png", tmp_path / "leaf.scan.jpg"
    cv2.imwrite(str(path), photo.image)
    cv2.imwrite(str(scan), photo.image)
    monkeypatch.setattr(photos, "rectify_file", lambda path, ocr: (photo.image, lambda: _perfect(photo)))
    monkeypatch.setattr(
        "benchmarks.common.memory.run_page_dewarp",
        lambda command, image: (None, Usage(1.0, 1.0, 50.0), "exit status 1"),
    )
    monkeypatch.setattr(
        "benchmarks.common.memory.run_uvdoc", lambda python, image: (photo.image, Usage(2.0, 2.0, 300.0), "")
    )
    monkeypatch.setattr(photos, "make_reader", lambda name, python: Judge())
    options = photos.Options("judge", "", "peer", "python", None, tmp_path / "pictures")
    given = RealPhoto(path, "folded", "Call me Ishmael. Some years ago", scan)
    figures = photos.run_photo(given, photos.Bench(options))
    assert figures.images["rectified"].error_rate == 0
    assert figures.images["rectified"].characters == figures.images["rectified"].words == 100
    against = figures.images["UVDoc"].scan
    assert against is not None
    assert against.distances.ms_ssim > 0.98
    assert against.edit_distance == 0
    assert "page-dewarp" not in figures.images
    assert figures.score("page-dewarp") == 0
    assert not figures.lost_to
    assert (tmp_path / "pictures" / "small" / "leaf.jpg").is_file()
    text = photo_report.format_photos([figures])
    assert "exit status 1" in text
    assert "0.000" in text
    held = photo_report.figures_by_photo([figures])["leaf"]
    assert held["sure_characters"] == 20
    assert {"words", "ms_ssim", "aligned_distortion_px"} <= held.keys()


def _read(name: str, kind: str, ours: float, peer: float | None) -> photo_report.PhotoFigures:
    def image(characters: float) -> photo_report.ImageFigures:
        distances = ScanDistances(characters / 100, 4.0, 0.5, 2.0)
        scan = photo_report.ScanFigures(distances, 7, 0.07)
        return photo_report.ImageFigures(600, 800, 0.1, characters, characters - 10, 90, scan)

    images = {"photo": image(50.0), "rectified": image(ours)}
    if peer is not None:
        images["UVDoc"] = image(peer)
    used = {"rectified": Usage(1.0, 1.0, 200.0), "UVDoc": Usage(3.0, 3.0, 400.0)}
    return photo_report.PhotoFigures(name, kind, images=images, usage=used)


def test_kinds_have_means_and_a_photo_without_a_page_counts_as_nothing() -> None:
    photos = [
        _read("a", "folded", 80.0, 90.0),
        _read("b", "folded", 90.0, None),
        _read("c", "book", 99.0, 99.4),
    ]
    lines = photo_report.format_kinds(photos).splitlines()
    rows = {line.split()[0]: line.split() for line in lines if line}
    assert " ".join(rows["folded"]) == "folded 2 50.0 / 40.0 85.0 / 75.0 1.0 s 200 45.0 / 40.0 3.0 s 400"
    assert rows["book"][1] == "1"
    # Within half a point of the peer is no loss.
    assert [line.split()[0] for line in lines[-2:]] == ["more", "a"]
    assert lines[-2].endswith(": 1 photos")


def test_scans_are_compared_on_photos_that_both_have() -> None:
    photos = [_read("a", "folded", 80.0, 90.0), _read("b", "folded", 60.0, None)]
    first, second, mean = photo_report.format_scans(photos).splitlines()[2:]
    assert first.split()[:3] == ["a", "0.800", "0.900"]
    assert second.split()[:3] == ["b", "0.600", "-"]
    assert mean.split()[:5] == ["mean", "of", "1", "0.800", "0.900"]
    assert photo_report.format_scans([]) == ""


def test_no_data_is_said_and_is_no_failure(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert photos.main(["--data", str(tmp_path)]) == 0
    assert "no photos" in capsys.readouterr().err


def test_a_run_without_reading_adopts_no_baseline(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        simulated.main(["--no-reading", "--update-baseline"])
    assert "OCR scores" in capsys.readouterr().err
