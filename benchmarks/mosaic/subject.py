"""What is being measured: the only calls of the benchmarks into the mosaic."""

from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from multiprocessing import get_context

import cv2

from benchmarks.common.stopwatch import Usage, measured
from services.arrays import RgbImage
from services.contract.mosaic import MosaicParameters
from services.errors import DocumentError
from services.mosaic.pipeline import mosaic
from services.mosaic.results import MosaicResult
from services.operations.reader import ocr_engine

DEFAULTS = MosaicParameters()


@dataclass(frozen=True, slots=True, eq=False)
class Attempt:
    """An answer, or why there is none; and what it took."""

    result: MosaicResult | None
    failure: str
    usage: Usage


def assemble(
    photos: Sequence[RgbImage], parameters: MosaicParameters = DEFAULTS, *, upright: bool = True
) -> Attempt:
    """The mosaic as the service makes it, without EXIF."""
    result, failure = None, ""
    engine = ocr_engine()
    with measured() as usage:
        try:
            result = mosaic(photos, replace(parameters, upright=upright), None, engine)
        except DocumentError as error:
            failure = f"{error.code}: {error}"
    return Attempt(result, failure, usage)


def assemble_fresh(
    photos: Sequence[RgbImage], parameters: MosaicParameters = DEFAULTS, *, upright: bool = True
) -> Attempt:
    """The same in a process that has done nothing before, so that its peak memory is the mosaic's own."""
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        return pool.submit(_answer, tuple(photos), parameters, upright).result()


def _answer(photos: tuple[RgbImage, ...], parameters: MosaicParameters, upright: bool) -> Attempt:
    cv2.setNumThreads(1)
    return assemble(photos, parameters, upright=upright)
