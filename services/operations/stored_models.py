"""Layout models as the app has stored them: read, and kept ready by the process that has read them."""

import json
from collections import OrderedDict
from collections.abc import Sequence

from services.contract.layout import ModelDocument
from services.errors import InvalidModel
from services.layout.model.layout_model import LayoutModel
from services.layout.model.model_document import model_from_document
from services.layout.page import InvalidLayout
from services.layout.pipeline import VersionedModel

MOST_BYTES = 80 * 2**20
"""Of the documents of the models that a process keeps ready; as objects they have five times as many. 200 models of
15 labels have 40 MB, one of 60 labels has 2.5 MB."""


class ReadyModels:
    """The models that were last used, each in one version, as many as their documents have `most_bytes` together."""

    def __init__(self, most_bytes: int = MOST_BYTES) -> None:
        self._most_bytes = most_bytes
        self._bytes = 0
        self._models: OrderedDict[str, tuple[bytes, LayoutModel]] = OrderedDict()

    def read(self, name: str, document: bytes) -> LayoutModel:
        """The model of a document of JSON, the same object as long as it is kept.

        A model that learns has a new version with every feedback; the one before makes room at once.

        Raises
        ------
        InvalidLayout
            When this release cannot read it.
        """
        kept = self._models.get(name)
        if kept is None or kept[0] != document:
            model = model_from_document(json.loads(document))
            self._drop(name)
            kept = self._models[name] = document, model
            self._bytes += len(document)
        self._models.move_to_end(name)
        while self._bytes > self._most_bytes and len(self._models) > 1:
            self._drop(next(iter(self._models)))
        return kept[1]

    def _drop(self, name: str) -> None:
        kept = self._models.pop(name, None)
        if kept is not None:
            self._bytes -= len(kept[0])


_READY = ReadyModels()


def open_models(models: Sequence[ModelDocument], ready: ReadyModels = _READY) -> list[VersionedModel]:
    """Models that were checked before they were stored, maybe by another release.

    Raises
    ------
    InvalidModel
        When one of them cannot be read by this release.
    """
    return [
        VersionedModel(_read(model, ready), model.version, model.genre, model.continues) for model in models
    ]


def read_model(stored: ModelDocument) -> LayoutModel:
    """One model that is not kept ready: one that learns, or is compared, is soon another.

    Raises
    ------
    InvalidModel
        When it cannot be read by this release.
    """
    return _read(stored, ReadyModels())


def _read(stored: ModelDocument, ready: ReadyModels) -> LayoutModel:
    try:
        return ready.read(stored.name, stored.document)
    except InvalidLayout as error:
        raise InvalidModel(
            f"Version {stored.version} of model {stored.name} cannot be read by this release ({error.detail}) "
            f"Initialize it again, delete it, or name the models that shall compete."
        ) from error
