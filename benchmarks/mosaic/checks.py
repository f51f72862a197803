"""What a mosaic must keep to besides accuracy: any order, any base, no ghosts, bad photos, time, memory, pictures.

python -m benchmarks mosaic_checks [--only order,ghosts,newspaper,speed,bad-input] [--orders N]
"""

import argparse
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import permutations
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.common.figures import plain_values, write_json
from benchmarks.common.places import OUTPUT, data_folder
from benchmarks.common.plots import load_picture, make_strip, save_picture
from benchmarks.common.workers import Progress
from benchmarks.mosaic.errors import Mesh
from benchmarks.mosaic.ghosts import MIXED_FROM, measure_mixture, mosaic_scale, shifted_photo
from benchmarks.mosaic.subject import DEFAULTS, Attempt, assemble, assemble_fresh
from services.arrays import RgbImage
from services.mosaic.results import MosaicResult
from simulation.flat_page import Page
from simulation.letter_pages import letter_pages
from simulation.mosaic_sets import MosaicSet, photograph_set

NAME = "mosaic_checks"
WANTED_SAME_PX = 1.0
GHOST_SHIFT_PX = 1.5
"""Shift of one photo that must leave no doubled word, px at 300 dpi."""
WANTED_CPU_S = {4: 8.0, 8: 18.0}
WANTED_PEAK_MB = 1200.0
_THREE_MEGAPIXELS = 3.0e6


@dataclass(frozen=True, slots=True)
class Check:
    """One finding: whether it is as wanted (None: nothing is wanted of it, it is for looking at)."""

    part: str
    name: str
    good: bool | None
    finding: str
    figures: dict[str, float]


def check_order(orders: int) -> list[Check]:
    """The same page whichever way the photos come, and whichever is the base."""
    made = photograph_set(letter_pages()[0], 4, 0.2, np.random.default_rng(101))
    reference = assemble(made.images, upright=False).result
    if reference is None:
        return [Check("order", "4 photos", False, "no mosaic", {})]
    found = []
    chosen = list(permutations(range(4)))[1:]
    rng = np.random.default_rng(0)
    for index in sorted(rng.choice(len(chosen), min(orders, len(chosen)), replace=False)):
        order = chosen[int(index)]
        result = assemble([made.images[k] for k in order], upright=False).result
        meshes = None if result is None else {k: result.patches[i].mesh for i, k in enumerate(order)}
        found.append(_compare(f"order {order}", reference, result, meshes))
    for base in range(4):
        result = assemble(made.images, replace(DEFAULTS, base=base), upright=False).result
        meshes = None if result is None else {k: patch.mesh for k, patch in enumerate(result.patches)}
        found.append(_compare(f"base {base}", reference, result, meshes))
    return found


def _compare(
    name: str, reference: MosaicResult, result: MosaicResult | None, meshes: Mapping[int, Mesh | None] | None
) -> Check:
    if result is None or meshes is None:
        return Check("order", name, False, "no mosaic", {})
    squares, lost = [], 0
    height, width = reference.image.shape[:2]
    for k, patch in enumerate(reference.patches):
        mesh = meshes[k]
        if (mesh is None) != (patch.mesh is None):
            lost += 1
        elif mesh is not None and patch.mesh is not None:
            within = np.all((patch.mesh >= 0) & (patch.mesh <= [width - 1, height - 1]), axis=-1)
            squares.append(((mesh - patch.mesh)[within] ** 2).sum(axis=-1))
    rms = float(np.sqrt(np.concatenate(squares).mean())) if squares else float("nan")
    sizes = np.abs(np.subtract(result.image.shape[:2], reference.image.shape[:2])).max()
    good = lost == 0 and rms <= WANTED_SAME_PX
    text = f"meshes {rms:.4f} px apart (RMS), page size {sizes} px, {lost} photos placed in one only"
    return Check("order", name, good, text, {"rms_px": rms, "size_px": float(sizes)})


def check_ghosts() -> list[Check]:
    """A photo composed beside its place: words of more than one photo, selective and average."""
    found = []
    for count, overlap, seed in ((2, 0.4, 102), (4, 0.4, 103)):
        made = photograph_set(letter_pages()[1], count, overlap, np.random.default_rng(seed))
        for composition in ("selective", "average"):
            parameters = replace(DEFAULTS, composition=composition, upright=False)  # type: ignore[arg-type]
            plain = assemble(made.images, parameters, upright=False).result
            if plain is None:
                found.append(Check("ghosts", f"{count} photos, {composition}", False, "no mosaic", {}))
                continue
            meshes = [patch.mesh for patch in plain.patches]
            k = _busiest(made, meshes)
            shift = (GHOST_SHIFT_PX * mosaic_scale(made, meshes), 0.0)
            with shifted_photo(k, shift):
                moved = assemble(made.images, parameters, upright=False).result
            assert moved is not None
            # A shift may move the crop: the places are those of the page that is measured.
            found_at = [patch.mesh for patch in moved.patches]
            after = measure_mixture(moved.image, made, found_at, (k, shift))
            selective = composition == "selective"
            good = after.mixed == 0 if selective else after.mixed > 0.5 * after.words
            text = (
                f"photo {k} moved by {GHOST_SHIFT_PX} px: {after.mixed} of {after.words} words are more than "
                f"{100 * MIXED_FROM:.0f} % of both its place and theirs, mean share {after.mean_share:.3f}"
            )
            figures = {
                "mixed": float(after.mixed),
                "words": float(after.words),
                "mean_share": after.mean_share,
            }
            found.append(
                Check("ghosts", f"{count} photos, {composition}", good and after.words > 0, text, figures)
            )
            save_picture(OUTPUT / NAME / f"ghosts_{count}_{composition}.jpg", moved.image)
    return found


def _busiest(made: MosaicSet, meshes: Sequence[Mesh | None]) -> int:
    """The placed photo that shares most with the others."""
    shared = [sum(s for pair, s in made.overlaps.items() if k in pair) for k in range(len(meshes))]
    return max((k for k, mesh in enumerate(meshes) if mesh is not None), key=lambda k: shared[k])


def check_speed() -> list[Check]:
    """Four and eight photos of 3 megapixels, and the same page at other sizes; each in a fresh process."""
    found = []
    for count in (4, 8):
        made = photograph_set(letter_pages()[0], count, 0.2, np.random.default_rng(104))
        attempt = assemble_fresh([_resized(image, _THREE_MEGAPIXELS) for image in made.images])
        good = attempt.usage.cpu_s <= WANTED_CPU_S[count] and attempt.usage.peak_mb <= WANTED_PEAK_MB
        found.append(_speed(f"{count} photos of 3 MP", attempt, good))
        if count == 4:
            for megapixels in (1.5, 6.0):
                images = [_resized(image, megapixels * 1e6) for image in made.images]
                found.append(_speed(f"4 photos of {megapixels:g} MP", assemble_fresh(images), None))
    return found


def _resized(image: RgbImage, pixels: float) -> RgbImage:
    factor = float(np.sqrt(pixels / (image.shape[0] * image.shape[1])))
    way = cv2.INTER_AREA if factor < 1 else cv2.INTER_CUBIC
    return np.asarray(cv2.resize(image, None, fx=factor, fy=factor, interpolation=way), np.uint8)


def _speed(name: str, attempt: Attempt, good: bool | None) -> Check:
    result, usage = attempt.result, attempt.usage
    if result is None:
        return Check("speed", name, False, f"no mosaic: {attempt.failure}", {})
    page_mp = result.image.shape[0] * result.image.shape[1] / 1e6
    stages = ", ".join(f"{stage} {spent / 1000:.2f}" for stage, spent in result.timings_ms.items())
    text = f"{usage.cpu_s:.2f} CPU s, peak {usage.peak_mb:.0f} MB, page of {page_mp:.1f} MP ({stages})"
    figures = {"cpu_s": usage.cpu_s, "peak_mb": usage.peak_mb, "page_mp": page_mp}
    return Check("speed", name, good, text, figures)


def check_bad_input() -> list[Check]:
    """A good page, or a problem that names the photo."""
    pages = letter_pages()
    halves = photograph_set(pages[0], 2, 0.2, np.random.default_rng(105))
    two, foot = halves.images, halves.cells.index((1, 0))
    four = photograph_set(pages[2], 4, 0.2, np.random.default_rng(106)).images
    blank = np.full((1200, 900, 3), 235, np.uint8)
    scan = np.ascontiguousarray(_rgb(pages[0])[: pages[0].height * 6 // 10])
    crowd = [blank] * 17
    wanted: Sequence[tuple[str, Sequence[RgbImage], Callable[[Attempt], bool]]] = (
        ("one photo", two[:1], lambda a: a.failure.startswith("invalid-option")),
        ("17 photos", crowd, lambda a: a.failure.startswith("invalid-option")),
        ("two different pages", (two[0], four[0]), lambda a: a.failure.startswith("not-overlapping")),
        ("a photo of another page", (*two, four[0]), lambda a: _placed(a) == {0, 1} and _names(a, 2)),
        ("identical photos", (two[0], two[0]), lambda a: _placed(a) == {0, 1}),
        ("a blank photo", (two[0], blank, two[1]), lambda a: _placed(a) == {0, 2} and _names(a, 1)),
        ("two blank photos", (blank, blank), lambda a: a.failure.startswith("no-text")),
        ("a scan beside photos", (scan, *two), lambda a: _placed(a) == {0, 1, 2}),
        ("a scan beside one photo", (scan, two[foot]), lambda a: _placed(a) == {0, 1}),
    )
    found = []
    for name, photos, is_good in wanted:
        attempt = assemble(photos)
        placed, result = _placed(attempt), attempt.result
        said = [] if result is None else [f"{notice.code}: {notice.detail}" for notice in result.warnings]
        text = (
            attempt.failure
            or f"placed {sorted(placed)} of {len(photos)}; {' | '.join(said) or 'no warnings'}"
        )
        found.append(Check("bad-input", name, is_good(attempt), text, {}))
        if result is not None:
            save_picture(OUTPUT / NAME / f"{name.replace(' ', '_')}.jpg", result.image)
    return found


def _placed(attempt: Attempt) -> set[int]:
    return set() if attempt.result is None else {k for k, p in enumerate(attempt.result.patches) if p.placed}


def _names(attempt: Attempt, index: int) -> bool:
    result = attempt.result
    return (
        result is not None
        and index in result.unplaced
        and any(f"images[{index}]" in notice.detail for notice in result.warnings)
    )


def _rgb(page: Page) -> RgbImage:
    return page.image if page.image.ndim == 3 else np.repeat(page.image[..., None], 3, axis=2)


def check_newspaper(data: Path) -> list[Check]:
    """The real photos: all placed, and how bright their pictures have become. The page is saved to be looked at."""
    files = sorted((data / "mosaic" / "newspaper").glob("*.jpg"))
    if not files:
        return [Check("newspaper", "photos", None, f"none in {data}/mosaic/newspaper", {})]
    photos = [load_picture(file) for file in files]
    found = []
    for composition in ("selective", "average"):
        attempt = assemble(photos, replace(DEFAULTS, composition=composition))  # type: ignore[arg-type]
        if attempt.result is None:
            found.append(Check("newspaper", composition, False, attempt.failure, {}))
            continue
        placed = _placed(attempt)
        mean, contrast = _picture_tones(photos, attempt.result)
        text = (
            f"placed {sorted(placed)} of {len(photos)}; pictures are {mean[0]:.0f} of 255 "
            f"(in the photos {mean[1]:.0f}), "
            f"their contrast {contrast[0]:.0f} ({contrast[1]:.0f})"
        )
        # Bleached: the picture's tones have left half of the way to white, or half of their contrast.
        kept = mean[0] < (255 + mean[1]) / 2 and contrast[0] > contrast[1] / 2
        good = (len(placed) == len(photos) and kept) if composition == "selective" else None
        figures = {"placed": float(len(placed)), "picture_mean": mean[0], "picture_contrast": contrast[0]}
        found.append(Check("newspaper", composition, good, text, figures))
        save_picture(OUTPUT / NAME / f"newspaper_{composition}.png", attempt.result.image)
        strip = make_strip(
            [*photos, attempt.result.image], [*(file.name for file in files), composition], height=700
        )
        save_picture(OUTPUT / NAME / f"newspaper_{composition}-strip.jpg", strip)
    return found


def _picture_tones(
    photos: Sequence[RgbImage], result: MosaicResult
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Median gray and standard deviation (mosaic, photos) where photos are dark over more than a few lines.

    Photos are brought to the mosaic by their meshes, their paper (90th percentile) scaled to 255.
    """
    page = np.asarray(cv2.cvtColor(result.image, cv2.COLOR_RGB2GRAY), np.float64)
    ours: list[NDArray[np.float64]] = []
    theirs: list[NDArray[np.float64]] = []
    for photo, patch in zip(photos, result.patches, strict=True):
        if patch.mesh is None:
            continue
        height, width = photo.shape[:2]
        gray = np.asarray(cv2.cvtColor(photo, cv2.COLOR_RGB2GRAY), np.float64)
        gray = np.minimum(255.0 * gray / max(float(np.percentile(gray, 90)), 1.0), 255.0)
        coarse = np.asarray(cv2.blur(gray, (width // 24, width // 24)))
        place = cv2.resize(patch.mesh, (width, height), interpolation=cv2.INTER_LINEAR).astype(np.float32)
        drawn = np.asarray(
            cv2.remap(page, place, np.empty(0, np.float32), cv2.INTER_LINEAR, borderValue=-1.0)
        )
        picture = (coarse < 130) & (drawn >= 0)
        ours.append(drawn[picture])
        theirs.append(gray[picture])
    here, there = np.concatenate(ours), np.concatenate(theirs)
    if not len(here):
        return (float("nan"),) * 2, (float("nan"),) * 2
    return (float(np.median(here)), float(np.median(there))), (float(here.std()), float(there.std()))


def main(arguments: Sequence[str] | None = None) -> int:
    """Run, print, save; 1 when something is not as wanted."""
    options = _parser().parse_args(arguments)
    cv2.setNumThreads(1)
    parts: dict[str, Callable[[], list[Check]]] = {
        "order": lambda: check_order(options.orders),
        "ghosts": check_ghosts,
        "newspaper": lambda: check_newspaper(data_folder(options.data)),
        "speed": check_speed,
        "bad-input": check_bad_input,
    }
    chosen = options.only.split(",") if options.only else list(parts)
    progress, done = Progress(len(chosen)), list[Check]()
    for part in chosen:
        done += parts[part]()
        progress.tell(part)
    print(f"===== {NAME} =====")
    for check in done:
        mark = {True: "yes", False: "NO", None: "-"}[check.good]
        print(f"{mark:<4}{check.part:<11}{check.name:<26}{check.finding}")
    write_json(OUTPUT / f"{NAME}.json", [plain_values(asdict(check)) for check in done])
    print(f"\nfigures and pictures: {OUTPUT}")
    return 0 if all(check.good is not False for check in done) else 1


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=f"python -m benchmarks {NAME}",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add: Callable[..., Any] = parser.add_argument
    add("--data", default=None, help="folder of the data (default: DOCUMENT_DATA, else ../shared/data)")
    add("--only", default="", help="comma-separated: order, ghosts, newspaper, speed, bad-input")
    add("--orders", type=int, default=4, help="how many of the other 23 orders of four photos")
    return parser
