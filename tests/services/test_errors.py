"""What the errors of the product carry, also across the border of a process."""

import pickle

import pytest

from services.errors import DocumentError, InvalidOption


def test_an_invalid_option_names_its_field() -> None:
    with pytest.raises(TypeError, match="field"):
        InvalidOption("an option is wrong")  # type: ignore[call-arg]


@pytest.mark.parametrize(
    "error", [InvalidOption("page: there is none", "page"), DocumentError("it failed", "page")]
)
def test_errors_cross_the_border_of_a_process(error: DocumentError) -> None:
    restored = pickle.loads(pickle.dumps(error))
    assert type(restored) is type(error)
    assert (str(restored), restored.detail, restored.field) == (error.detail, error.detail, "page")
