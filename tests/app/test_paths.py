"""Templates of paths."""

import pytest

from app.http.paths import PathTemplates

SAMPLE = "/layout/models/{name}/samples/{id}"
ARCHIVE, IMPORT = SAMPLE.replace("{id}", "archive"), SAMPLE.replace("{id}", "import")
TEMPLATES = PathTemplates(["/layout", "/layout/models/{name}", ARCHIVE, SAMPLE, IMPORT])


@pytest.mark.parametrize(
    ("path", "template"),
    [
        ("/layout", "/layout"),
        ("/layout/", None),
        ("/layout/models", None),
        ("/layout/models/", None),
        ("/layout/models/letter", "/layout/models/{name}"),
        ("/layout/models/{name}", "/layout/models/{name}"),
        ("/layout/models/a/b", None),
        ("/layout/models/a/samples", None),
        ("/layout/models/a/samples/b", SAMPLE),
        ("/layout/models/a/samples/archive", ARCHIVE),
        ("/layout/models/a/samples/import", IMPORT),
        ("/layout/models/a/samples/b/c", None),
        ("/layout\n", None),
        ("/layout/models/a/samples/archive\n", SAMPLE),
        ("/layout/models/a/samples\n", None),
        ("", None),
    ],
)
def test_the_template_of_a_path(path: str, template: str | None) -> None:
    assert TEMPLATES.match(path) == template
