"""Answers in a form that every generator of clients types: no tuples, no null, unions told apart by a property.

The models of `services.contract.answers` stay as they are. Their schema is rewritten by a few rules, each of which also
rewrites what it describes, so that document and answer cannot differ.

- Two, three and four numbers in a row are a `Point`, a `Vector` and a `Box`.
- What is null is left out; of a list with unknown entries, the list.
- The models of a union have a property that tells them apart (`TAGS`).
"""

from collections.abc import Callable, Mapping
from typing import Any, Final

from pydantic import BaseModel

from services.contract.answers.mosaic import MosaicResult
from services.contract.answers.rectify import PagesResult

Schema = dict[str, Any]
Convert = Callable[[Any], Any]
Rule = tuple[Schema, Convert]
"""A plain schema, and what brings a value into its form."""

_PLACE: Final = "#/components/schemas/"
_NUMBER: Final[Schema] = {"type": "number"}


def _row(title: str, description: str, *names: str) -> Schema:
    return {
        "title": title,
        "description": description,
        "type": "object",
        "properties": {name: _NUMBER for name in names},
        "required": list(names),
        "additionalProperties": False,
    }


ROWS: Final[dict[int, Schema]] = {
    2: _row("Point", "A point, pixels.", "x", "y"),
    3: _row("Vector", "A direction in space.", "x", "y", "z"),
    4: _row("Box", "A rectangle from its top left to its bottom right, pixels.", "x0", "y0", "x1", "y1"),
}
"""Objects in place of that many numbers."""
TAGS: Final = {"RectifyResult": ("state", "flat"), "FailedPage": ("state", "failed")}
"""Property and value that tell the models of a union apart."""


class PlainAnswer:
    """The plain form of a model's answers."""

    def __init__(self, model: type[BaseModel]) -> None:
        schema = model.model_json_schema(mode="serialization", ref_template="{model}")
        self._models: dict[str, Schema] = {**schema.pop("$defs", {}), model.__name__: schema}
        self._rules = {
            name: {key: self._rule(each) for key, each in model.get("properties", {}).items()}
            for name, model in self._models.items()
        }
        self._root = model.__name__
        self.reference: Schema = _reference(self._root)
        """The schema of the answer, among `components`."""

    def components(self) -> dict[str, Schema]:
        """The schemas of all plain models by their names."""
        made = {f"Plain{name}": self._component(name) for name in self._models}
        return {**{row["title"]: row for row in ROWS.values()}, **made}

    def convert(self, document: dict[str, Any]) -> dict[str, Any]:
        """The plain form of the JSON `document` of an answer."""
        return self._convert_model(self._root, document)

    def _component(self, name: str) -> Schema:
        model, rules = self._models[name], self._rules[name]
        absent = {key for key, schema in model.get("properties", {}).items() if _may_be_absent(schema)}
        tag, value = TAGS.get(name, (None, None))
        tagged: dict[str, Schema] = {tag: {"type": "string", "enum": [value]}} if tag else {}
        return {
            **model,
            "title": f"Plain{name}",
            "properties": {**tagged, **{key: schema for key, (schema, _) in rules.items()}},
            "required": [*tagged, *(key for key in model.get("required", ()) if key not in absent)],
        }

    def _convert_model(self, name: str, value: dict[str, Any]) -> dict[str, Any]:
        rules = self._rules[name]
        known = {
            key: each
            for key, each in value.items()
            if each is not None and not (isinstance(each, list) and None in each)
        }
        converted = {key: rules[key][1](each) for key, each in known.items()}
        return {**dict([TAGS[name]]), **converted} if name in TAGS else converted

    def _rule(self, schema: Schema) -> Rule:
        for key, make in (
            ("anyOf", self._choice),
            ("oneOf", self._told_choice),
            ("$ref", self._model),
            ("prefixItems", self._row),
            ("items", self._list),
        ):
            if key in schema:
                plain, convert = make(schema)
                described = {key: schema[key] for key in ("description",) if key in schema}
                return {**plain, **described}, convert
        return {key: value for key, value in schema.items() if (key, value) != ("default", None)}, _same

    def _choice(self, schema: Schema) -> Rule:
        """Of one kind, or null; or one of several models."""
        options = [option for option in schema["anyOf"] if option.get("type") != "null"]
        if len(options) == 1:
            return self._rule(options[0])
        names = [option["$ref"] for option in options]

        def convert(value: dict[str, Any]) -> dict[str, Any]:
            name = next(name for name in names if set(self._models[name]["required"]) <= set(value))
            return self._convert_model(name, value)

        return _union(TAGS[names[0]][0], {TAGS[name][1]: name for name in names}), convert

    def _told_choice(self, schema: Schema) -> Rule:
        """One of several models that the answer tells apart as it is."""
        tag, mapping = schema["discriminator"]["propertyName"], schema["discriminator"]["mapping"]
        return _union(tag, mapping), lambda value: self._convert_model(mapping[value[tag]], value)

    def _model(self, schema: Schema) -> Rule:
        name: str = schema["$ref"]
        return _reference(name), lambda value: self._convert_model(name, value)

    def _row(self, schema: Schema) -> Rule:
        first, length = schema["prefixItems"][0], len(schema["prefixItems"])
        if first.get("type") != "number":
            return self._list({"items": first, "minItems": length, "maxItems": length, "type": "array"})
        names = ROWS[length]["required"]
        return {"$ref": _PLACE + ROWS[length]["title"]}, lambda value: dict(zip(names, value, strict=True))

    def _list(self, schema: Schema) -> Rule:
        item, convert = self._rule(schema["items"])
        return {**schema, "items": item}, _same if convert is _same else lambda value: [*map(convert, value)]


def _same(value: Any) -> Any:
    return value


def _reference(name: str) -> Schema:
    return {"$ref": f"{_PLACE}Plain{name}"}


def _union(tag: str, mapping: Mapping[str, str]) -> Schema:
    places = {value: _reference(name)["$ref"] for value, name in mapping.items()}
    return {
        "oneOf": [{"$ref": place} for place in places.values()],
        "discriminator": {"propertyName": tag, "mapping": places},
    }


def _may_be_absent(schema: Schema) -> bool:
    """Whether the value may be null, or a list with null in it."""
    options = schema.get("anyOf") or schema.get("items", {}).get("anyOf") or ()
    return any(option.get("type") == "null" for option in options)


PLAIN_PAGES: Final = PlainAnswer(PagesResult)
PLAIN_MOSAIC: Final = PlainAnswer(MosaicResult)
