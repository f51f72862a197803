"""Operations that do what the upload says, so that a test can have any fate befall a worker."""

from dataclasses import fields
from pathlib import Path

from services.contract.operations import Operation, Operations
from services.contract.worker_facts import WorkerFacts
from tests.app import scripted_kept_pages, scripted_layout, scripted_models, scripted_rectify


def warm_up(content_features: Path | None) -> WorkerFacts:
    """What workers of the scripted service say of themselves."""
    return WorkerFacts("scripted", ("eng", "fra"))


_FLOWS = (scripted_rectify, scripted_kept_pages, scripted_layout, scripted_models)


def _operation(name: str) -> Operation[object]:
    """The operation of this name, in the module of its flow."""
    home = next((flow.__name__ for flow in _FLOWS if hasattr(flow, name)), __name__)
    return Operation(f"{home}:{name}")


OPERATIONS = Operations(**{field.name: _operation(field.name) for field in fields(Operations)})
