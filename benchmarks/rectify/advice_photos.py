"""Small photos of known text with a wide spread of quality: crops of pages, seen aslant, spoilt in one way or more.

The photos are crops, so that 150 of them take minutes. The true homography flattens them: what OCR then misreads is due
to the photo's quality, not to the geometry.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from rapidfuzz.distance import Levenshtein

from services.arrays import Floats, Homography, Points, RgbImage
from services.capture.quality import CaptureQuality, measure_quality
from services.errors import NoText
from services.geometry.homographies import transform_points
from services.imaging.illumination import flatten_illumination
from services.ocr.engine import Word
from services.operations.page_reading import reading_engine
from services.rectify.analysis.found_text import find_text
from services.rectify.view.print_sample import print_heights
from services.text.page_text import doubtful_letters
from simulation.degradation import Degradation, Exposure, degrade, expose
from simulation.flat_page import Page
from simulation.pages import own_pages

PHOTO = (600, 420)
"""Width and height of a photo of small print; more pixels of large print, up to three times as many."""
PAGE_LETTER_PX = 42 * 0.5
"""Height of small letters on a page of `own_pages()`, whose print has 42 pixels an em."""
GROUPS = ("distance", "blur", "motion", "noise", "contrast", "all")
_LETTERS = {"distance": (2.8, 9.0), "noise": (5.0, 16.0), "contrast": (6.0, 24.0)}
"""Heights of small letters in the photo, where they are not 6 to 26 pixels."""


@dataclass(frozen=True, slots=True)
class Damage:
    """How a photo is taken and spoilt; lengths in heights of small letters, angles in radians.

    `seed` fixes the shadow and the direction of the motion, so that photos with one damage differ by their text and
    their noise alone.
    """

    group: str
    letter_px: float
    tilt_rad: float
    azimuth_rad: float
    roll_rad: float
    ink: float
    blur: float
    motion: float
    noise_sigma: float
    shadow: float
    jpeg_quality: int
    gain: float
    seed: int


@dataclass(frozen=True, slots=True)
class Measured:
    """A photo's figures, its measured character error, and usual focus measures (larger is sharper).

    `doubtful` is the share of letters in words that are probably wrong, by the OCR's confidences.
    """

    quality: CaptureQuality
    error: float
    doubtful: float
    focus: tuple[float, float, float]
    group: str
    """What the photo suffers from most."""
    damage: int = 0
    """Number of its damage; photos with one number differ by their text and their noise alone."""


@dataclass(frozen=True, slots=True, eq=False)
class CropPhoto:
    """A photo, the page's homography, and the words (text, box on the page) that are whole in it."""

    image: RgbImage
    H_photo_page: Homography
    words: tuple[tuple[str, tuple[float, float, float, float]], ...]
    group: str


def make_photos(count: int, seed: int = 19, repeats: int = 1) -> Iterator[tuple[CropPhoto, ...]]:
    """Photos with letters of 2 to 26 pixels; a sixth each is small, blurred, moved, noisy or faint above all, or all.

    Of each damage there are `repeats` photos, with other text and other noise.
    """
    rng = np.random.default_rng(seed)
    pages = [readable(page) for page in own_pages()]
    for index in range(count):
        damage = draw_damage(GROUPS[index % len(GROUPS)], rng)
        yield tuple(
            _crop(pages[(index + again) % len(pages)], damage, np.random.default_rng([seed, index, again]))
            for again in range(repeats)
        )


def draw_damage(group: str, rng: np.random.Generator) -> Damage:
    """A damage of this kind. Its ranges are such that the errors lie anywhere between none and all characters."""
    every = group == "all"
    low, high = _LETTERS.get(group, (6.0, 26.0))
    ink = 0.9
    if group == "contrast":
        ink = float(np.exp(rng.uniform(np.log(0.03), np.log(0.3))))
    elif every:
        ink = rng.uniform(0.15, 1.0)
    blur = {"blur": rng.uniform(0.1, 0.4), "all": rng.uniform(0.02, 0.25)}.get(group, 0.04)
    motion = {"motion": rng.uniform(0.2, 1.2), "all": float(rng.choice([0, 0, 0.5]))}.get(group, 0.0)
    noise = {"noise": rng.uniform(15, 90), "contrast": rng.uniform(2, 8), "all": rng.uniform(1, 25)}
    return Damage(
        group,
        float(np.exp(rng.uniform(np.log(low), np.log(high)))),
        rng.uniform(0, 0.6),
        rng.uniform(0, 2 * np.pi),
        rng.uniform(-0.1, 0.1),
        ink,
        blur,
        motion,
        noise.get(group, rng.uniform(1, 4)),
        rng.uniform(0, 0.6) if every or group == "contrast" else 0.0,
        int(rng.integers(15, 60)) if every or group == "noise" else 85,
        float(rng.uniform(0.6, 1.02)),
        int(rng.integers(2**32)),
    )


def readable(page: Page) -> Page:
    """`page` with those of its words that OCR reads right on the page itself: others say nothing about a photo."""
    engine, _ = reading_engine(None)
    gray = page.image if page.image.ndim == 2 else cv2.cvtColor(page.image, cv2.COLOR_RGB2GRAY)
    read = engine.read_page(np.asarray(gray, np.uint8))
    lines = tuple(
        tuple(
            word for word in line if not misread_share([(word.text, word.box)], read, lambda points: points)
        )
        for line in page.lines
    )
    return replace(page, lines=lines)


def _crop(page: Page, damage: Damage, rng: np.random.Generator) -> CropPhoto:
    """One photo of a part of `page`; `rng` draws the part and the noise."""
    letter = damage.letter_px
    enlarged = float(np.clip(letter / 10, 1.0, 1.8))
    width, height = round(PHOTO[0] * enlarged), round(PHOTO[1] * enlarged)
    scale = letter / PAGE_LETTER_PX
    across, down = width / scale, height / scale
    x = rng.uniform(0.1 * page.width, max(0.9 * page.width - across, 0.1 * page.width + 1))
    y = rng.uniform(0.1 * page.height, max(0.9 * page.height - down, 0.1 * page.height + 1))
    angles = (damage.tilt_rad, damage.azimuth_rad, damage.roll_rad)
    H = _view(x + across / 2, y + down / 2, scale, *angles, (width, height))
    ink = page.image if page.image.ndim == 3 else cv2.cvtColor(page.image, cv2.COLOR_GRAY2RGB)
    # Area averages by a photo of twice the size, or small print would be aliased.
    fine = cv2.warpPerspective(
        _reduced(ink, scale),
        np.diag([2.0, 2.0, 1.0]) @ H @ np.diag([_step(scale), _step(scale), 1.0]),
        (2 * width, 2 * height),
        flags=cv2.INTER_LINEAR,
        borderValue=(255, 255, 255),
    )
    photo = cv2.resize(fine, (width, height), interpolation=cv2.INTER_AREA).astype(np.float32)
    photo = 235 - (255 - photo) * damage.ink * 0.9
    optics = Degradation(
        shadow=damage.shadow, blur_sigma_px=damage.blur * letter, motion_px=damage.motion * letter
    )
    sensor = Degradation(noise_sigma=damage.noise_sigma, jpeg_quality=damage.jpeg_quality)
    seen = degrade(np.clip(photo, 0, 255).astype(np.uint8), optics, np.random.default_rng(damage.seed))
    spoilt = expose(degrade(seen, sensor, rng), Exposure(gain=damage.gain))
    words = tuple(
        (word.text, word.box) for line in page.lines for word in line if _whole(H, word.box, width, height)
    )
    return CropPhoto(spoilt, H, words, damage.group)


def _step(scale: float) -> float:
    """Page pixels per pixel of the reduced page from which a photo is drawn."""
    return max(1.0, 0.5 / scale)


def _reduced(page: RgbImage, scale: float) -> RgbImage:
    step = _step(scale)
    size = (round(page.shape[1] / step), round(page.shape[0] / step))
    return np.asarray(cv2.resize(page, size, interpolation=cv2.INTER_AREA) if step > 1 else page, np.uint8)


def _view(
    x: float, y: float, scale: float, tilt: float, azimuth: float, roll: float, size: tuple[int, int]
) -> Homography:
    """H_photo_page of a camera above (x, y) of the page, tilted by `tilt` towards `azimuth` (rad)."""
    focal = 1.2 * max(size)
    axis = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    R = cv2.Rodrigues(axis * tilt)[0] @ cv2.Rodrigues(np.array([0.0, 0.0, roll]))[0]
    distance = focal / scale
    K = np.array([[focal, 0, (size[0] - 1) / 2], [0, focal, (size[1] - 1) / 2], [0, 0, 1.0]])
    plane = np.column_stack([R[:, 0], R[:, 1], [0, 0, distance] - x * R[:, 0] - y * R[:, 1]])
    H = K @ plane
    return np.asarray(H / H[2, 2], np.float64)


def _corners(box: Sequence[float]) -> Points:
    x0, y0, x1, y1 = box
    return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]], np.float64)


def _whole(H: Homography, box: Sequence[float], width: int, height: int) -> bool:
    at = transform_points(H, _corners(box))
    return bool((at > 2).all() and (at < [width - 3, height - 3]).all())


def read_photo(photo: CropPhoto) -> tuple[float, list[Word]] | None:
    """Share of the characters that OCR misreads at the places of their words, and the words that it reads.

    None where the photo shows few words.
    """
    if len(photo.words) < 8:
        return None
    height, width = photo.image.shape[:2]
    low = np.min([box[:2] for _, box in photo.words], axis=0) - 30.0
    high = np.max([box[2:] for _, box in photo.words], axis=0) + 30.0
    middle = np.array([[width / 2, height / 2]])
    ahead = transform_points(np.linalg.inv(photo.H_photo_page), middle) + np.array([[1.0, 0.0]])
    ahead = transform_points(photo.H_photo_page, ahead) - middle
    scale = max(
        float(np.linalg.norm(ahead)), 18.0 / PAGE_LETTER_PX
    )  # small print is drawn larger, as a page is
    H_page_flat = np.array([[1 / scale, 0, low[0]], [0, 1 / scale, low[1]], [0, 0, 1.0]])
    size = (int((high[0] - low[0]) * scale), int((high[1] - low[1]) * scale))
    flat = cv2.warpPerspective(
        photo.image,
        photo.H_photo_page @ H_page_flat,
        size,
        flags=cv2.INTER_CUBIC | cv2.WARP_INVERSE_MAP,
        borderMode=cv2.BORDER_REPLICATE,
    )
    gray = np.asarray(cv2.cvtColor(flat, cv2.COLOR_RGB2GRAY), np.uint8)
    engine, _ = reading_engine(None)
    read = engine.read_page(flatten_illumination(gray))
    return misread_share(photo.words, read, lambda points: transform_points(H_page_flat, points)), read


def misread_share(
    words: Sequence[tuple[str, tuple[float, float, float, float]]],
    read: Sequence[Word],
    to_page: Callable[[Points], Points],
) -> float:
    """Edit distance between each word and what was read at its place, over all characters; at most 1 a character."""
    centres = np.array([[(w.box[0] + w.box[2]) / 2, (w.box[1] + w.box[3]) / 2] for w in read]).reshape(-1, 2)
    at = to_page(centres) if len(centres) else centres
    wrong = total = 0
    for text, (x0, y0, x1, y1) in words:
        rim = 0.3 * (y1 - y0)
        inside = (at > [x0 - rim, y0 - rim]).all(axis=1) & (at < [x1 + rim, y1 + rim]).all(axis=1)
        found = "".join(read[k].text for k in np.flatnonzero(inside))
        total += len(text)
        wrong += min(Levenshtein.distance(text, found), len(text))
    return wrong / max(total, 1)


def usual_focus_measures(gray: np.ndarray) -> tuple[float, float, float]:
    """Variance of the Laplacian, Tenengrad, and Brenner's measure (larger is sharper)."""
    across, down = cv2.Sobel(gray, cv2.CV_32F, 1, 0), cv2.Sobel(gray, cv2.CV_32F, 0, 1)
    values = gray.astype(np.float32)
    brenner = float(np.mean((values[:, 2:] - values[:, :-2]) ** 2))
    return float(cv2.Laplacian(gray, cv2.CV_32F).var()), float(np.mean(across**2 + down**2)), brenner


def page_mesh(photo: CropPhoto, nodes: int = 17) -> Floats:
    """Photo points (nodes, nodes, 2) of the flat page over the photo's words, as the mesh of an answer has them."""
    boxes = np.array([box for _, box in photo.words])
    x = np.linspace(boxes[:, 0].min(), boxes[:, 2].max(), nodes)
    y = np.linspace(boxes[:, 1].min(), boxes[:, 3].max(), nodes)
    page = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    return np.asarray(transform_points(photo.H_photo_page, page).reshape(nodes, nodes, 2))


def measure_photos(count: int, seed: int = 19, repeats: int = 2) -> Iterator[Measured]:
    """Figures and errors of simulated photos; those without text that is found are left out."""
    for number, photos in enumerate(make_photos(count, seed, repeats)):
        for photo in photos:
            read = read_photo(photo)
            quality = None if read is None else measure_figures(photo)
            if quality is not None and read is not None:
                gray = np.asarray(cv2.cvtColor(photo.image, cv2.COLOR_RGB2GRAY), np.uint8)
                doubtful = doubtful_letters(read[1])
                yield Measured(quality, read[0], doubtful, usual_focus_measures(gray), photo.group, number)


def measure_figures(photo: CropPhoto) -> CaptureQuality | None:
    """The figures that the product measures; None where it finds no text."""
    gray = np.asarray(cv2.cvtColor(photo.image, cv2.COLOR_RGB2GRAY), np.uint8)
    try:
        text = find_text(photo.image)
    except NoText:
        return None
    heights = print_heights(text.text) / text.factor
    return measure_quality(gray, text.characters, heights, page_mesh(photo))
