"""The operations that the contract names are there, and answer what it says."""

from dataclasses import fields
from importlib import import_module
from typing import get_args, get_type_hints

import pytest

from services.contract.operations import Operation, Operations


@pytest.mark.parametrize("name", [field.name for field in fields(Operations)])
def test_an_operation_answers_what_the_contract_says(name: str) -> None:
    operation: Operation[object] = getattr(Operations(), name)
    module, _, function = operation.partition(":")
    answer = get_type_hints(getattr(import_module(module), function))["return"]
    assert get_args(get_type_hints(Operations)[name]) == (answer,)


def test_workers_begin_with_the_modules_of_all_operations() -> None:
    operations = Operations(
        rectify=Operation("a.b:f"), bind_done_pages=Operation("a.b:h"), mosaic=Operation("a.b:g")
    )
    assert operations.modules.count("a.b") == 1
    assert set(Operations().modules) - set(operations.modules) == {
        "services.operations.mosaic",
        "services.operations.rectify_documents",
    }
