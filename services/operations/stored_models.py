"""Parsing of stored layout models, and a cache of parsed models in each process."""

import json
from collections import OrderedDict
from collections.abc import Sequence

from services.contract.layout import MOST_MODEL_BYTES, ModelDocument
from services.errors import InvalidModel
from services.layout.model.layout_model import LayoutModel
from services.layout.model.model_document import model_from_document
from services.layout.page import InvalidLayout
from services.layout.pipeline import VersionedModel


class ModelCache:
    """A cache of the models that were used last, one version of each, up to `most_bytes` of documents."""

    def __init__(self, most_bytes: int = MOST_MODEL_BYTES) -> None:
        self._most_bytes = most_bytes
        self._bytes = 0
        self._models: OrderedDict[str, tuple[bytes, LayoutModel]] = OrderedDict()

    def find(self, name: str, document: bytes) -> LayoutModel | None:
        """The model in a JSON document if it is cached."""
        kept = self._models.get(name)
        return None if kept is None or kept[0] != document else kept[1]

    def read(self, name: str, document: bytes) -> LayoutModel:
        """The model in a JSON document; the same object while it is cached.

        Every feedback makes a new version of a model. The earlier version then leaves the cache.

        Raises
        ------
        InvalidLayout
            When this release cannot read the document.
        """
        model = self.find(name, document)
        if model is None:
            model = model_from_document(json.loads(document))
            self._drop(name)
            self._models[name] = document, model
            self._bytes += len(document)
        self._models.move_to_end(name)
        while self._bytes > self._most_bytes and len(self._models) > 1:
            self._drop(next(iter(self._models)))
        return model

    def _drop(self, name: str) -> None:
        kept = self._models.pop(name, None)
        if kept is not None:
            self._bytes -= len(kept[0])


_READY = ModelCache()


def open_models(models: Sequence[ModelDocument], ready: ModelCache = _READY) -> list[VersionedModel]:
    """The parsed models, from the cache where possible.

    Raises
    ------
    InvalidModel
        When this release cannot read a model: another release may have stored it.
    """
    return [
        VersionedModel(_read(model, ready), model.version, model.genre, model.continues) for model in models
    ]


def read_model(stored: ModelDocument, ready: ModelCache = _READY) -> LayoutModel:
    """The parsed model. It is not added to the cache, since a model that learns soon has another version.

    The process that recognized the page has it in the cache.

    Raises
    ------
    InvalidModel
        When this release cannot read the model.
    """
    return ready.find(stored.name, stored.document) or _read(stored, ModelCache())


def _read(stored: ModelDocument, ready: ModelCache) -> LayoutModel:
    try:
        return ready.read(stored.name, stored.document)
    except InvalidLayout as error:
        raise InvalidModel(
            f"Version {stored.version} of model {stored.name} cannot be read by this release ({error.detail}) "
            f"Initialize it again, delete it, or name the models that shall compete."
        ) from error
