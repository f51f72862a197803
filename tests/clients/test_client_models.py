"""The types of both clients are those of the document, and Python's are read as they are."""

from pathlib import Path

import pytest

from deploy import client_models
from document_rectification_client import LayoutResult
from document_rectification_client.reading import read
from tests.end_to_end.typescript import NEEDS_NODE


@pytest.fixture(scope="module")
def schemas() -> dict[str, client_models.Schema]:
    """Schemas of all answers."""
    return client_models.answer_schemas()


def said_by(path: Path) -> str:
    return path.read_text("utf-8")


def test_python_has_the_types_of_the_document(schemas: dict[str, client_models.Schema]) -> None:
    assert said_by(client_models.PYTHON) == client_models.python_of(
        schemas, client_models.option_schemas()
    ), "make client-models"


@NEEDS_NODE
def test_typescript_has_the_types_of_the_document(schemas: dict[str, client_models.Schema]) -> None:
    made = client_models.typescript_of({**schemas, **client_models.option_schemas()})
    assert said_by(client_models.TYPESCRIPT) == made, "make client-models"


def test_a_form_without_a_rule_is_refused() -> None:
    odd = {"Odd": {"properties": {"a": {"type": "array", "contains": {"type": "string"}}}}}
    with pytest.raises(KeyError, match="array"):
        client_models.python_of(odd, {})


@pytest.mark.parametrize("document", [[], {}, None, {"id": 1, "class": 3}])
def test_what_is_no_answer_is_a_value_error(document: object) -> None:
    with pytest.raises(ValueError, match="no LayoutResult"):
        read(LayoutResult, document)


def test_an_option_that_is_json_may_be_a_list_and_a_turn_a_number() -> None:
    options = client_models.option_schemas()
    rectify, layout = (
        {key: client_models._type(each) for key, each in options[name]["properties"].items()}
        for name in ("RectifyOptions", "LayoutOptions")
    )
    assert {"image", "zones_file"} & {*rectify, *layout} == set()
    assert (rectify["corners"], rectify["rotate"]) == ("str | list[Any]", "str | int")
    assert (rectify["paper"], rectify["margin"], rectify["camera"]) == ("str", "float", "str")
    assert layout["zones"] == "str | dict[str, Any]"
