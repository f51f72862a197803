"""`python -m app remeasure [CLASS...]`: samples with images are measured again, and each model gets a new version.

The service may run meanwhile. Samples without an image stay as they are, and take part in the new version.
"""

import asyncio
import sys
from collections.abc import Sequence
from contextlib import AsyncExitStack

from fastapi import FastAPI

from app.engine.base import TimeLimit
from app.learning.labelled_pages import layout_settings
from app.learning.samples import NoSamples, items_of, samples_note, samples_to_learn_from
from app.logs import configure_logs
from app.main import create_app
from app.run_folder import run_folder
from app.settings import Settings
from app.state import AppState
from models.errors import NotFound, StoreError, VersionConflict
from models.repository import Author, Store, changes_by
from services.contract.layout_models import SEGMENTATION
from services.errors import DocumentError

_ATTEMPTS = 5
"""Feedback may make a version while a model is computed; it is then computed again, with the new sample."""


def remeasure(names: Sequence[str], app: FastAPI | None = None) -> int:
    """Measure the samples of the named classes (none named: of all); the exit status, 1 if something failed."""
    settings = Settings()
    configure_logs(settings.log_level)
    if not settings.workers:
        sys.exit("WORKERS=0: samples are measured by workers.")
    app = app or create_app(settings)
    state: AppState = app.state.document_rectification
    with run_folder():
        return asyncio.run(_remeasure_all(state, names))


async def _remeasure_all(state: AppState, names: Sequence[str]) -> int:
    async with AsyncExitStack() as stack:
        await stack.enter_async_context(state.store.opened())
        stack.callback(state.locks.close)
        await state.blobs.open()
        stack.push_async_callback(state.blobs.close)
        await state.engine.start()
        stack.push_async_callback(state.engine.drain, 0.0)
        known = [model.name for model in await state.store.call(Store.models)]
        images = await state.sample_images.sizes()
        print(f"Segmentation {SEGMENTATION}; {len(images)} samples have an image.")
        failures = lost = 0
        for name in names or known:
            try:
                failed, without = await _remeasure_class(state, name, images)
                failures, lost = failures + failed, lost + without
            except (DocumentError, StoreError) as error:
                failures += 1
                print(f"{name}: {error.detail}")
        if lost and not images and state.settings.max_sample_images_bytes:
            failures += 1
            print(
                f"{lost} samples were made from images, and not one image is there. If the database was restored, "
                "restore DATA_DIR/blobs (or the bucket of BLOB_URL) too: docs/operations.md, Back-up."
            )
    return 1 if failures else 0


async def _remeasure_class(state: AppState, name: str, images: dict[str, int]) -> tuple[int, int]:
    """Measure the samples of a class and make a version of its model.

    Returns the number of samples that failed, and of those that were made from an image that is not there.
    """
    samples = await state.store.call(
        lambda store: {each.id: each.document.get("segmentation") for each in store.each_sample(name)}
    )
    with_image = [sample_id for sample_id in samples if sample_id in images]
    lost = sum(segmentation is not None and id not in images for id, segmentation in samples.items())
    changed = failed = 0
    for sample_id in with_image:
        try:
            changed += await _remeasure_sample(state, name, sample_id, images[sample_id])
        except NotFound:  # the sample, or its image, was deleted meanwhile
            continue
        except DocumentError as error:
            failed += 1
            print(f"{name}: sample {sample_id}: {error.detail}")
    print(
        f"{name}: {len(samples)} samples; {len(with_image)} measured again, {changed} of them changed, "
        f"{failed} failed; {len(samples) - len(with_image)} have no image and stay as they are"
        f"{f' ({lost} of them had one)' if lost else ''}. "
        f"{await _make_version(state, name)}"
    )
    return failed, lost


async def _remeasure_sample(state: AppState, name: str, sample_id: str, size_bytes: int) -> bool:
    """Whether the sample has changed."""
    before = (await state.store.call(lambda store: store.sample(name, sample_id))).document
    image = await state.sample_images.picture(sample_id, size_bytes)
    work = state.operations.remeasure_sample
    after = await state.engine.submit(work, image, before, layout_settings(state.settings))
    if after == before:
        return False
    await state.store.call(lambda store: store.replace_sample(name, sample_id, after))
    return True


async def _make_version(state: AppState, name: str) -> str:
    """A new version of a model from its samples, if it has a version; a sentence about it."""
    limit = TimeLimit(state.settings.model_timeout_s, "MODEL_TIMEOUT_S")
    for _ in range(_ATTEMPTS):
        version = (await state.store.call(lambda store: store.model_summary(name))).version
        if version is None:
            return "It has no model yet."
        try:
            samples = await state.store.call(lambda store: samples_to_learn_from(store, name))
        except NoSamples:
            return f"Version {version} stays, since there are no samples."
        documents = [sample.document for sample in samples]
        draft = await state.engine.submit(
            state.operations.initialize_model,
            name,
            documents,
            layout_settings(state.settings),
            await state.store.call(lambda store: items_of(store, name)),
            time_limit=limit,
        )
        note = samples_note(samples)
        try:
            with changes_by(Author(None, "samples measured again")):
                made = await state.store.call(
                    lambda store, draft=draft, version=version, note=note: store.add_version(  # type: ignore[misc]
                        name, draft.document, "initialize", expected_version=version, note=note
                    )
                )
        except VersionConflict:
            continue
        return f"Version {made.version} of the model is made from {note}."
    return "Its model changed all the time; run the command again."
