"""JSON as dataclasses."""

import dataclasses
import functools
from types import NoneType, UnionType
from typing import Any, Literal, TypeVar, Union, cast, get_args, get_origin, get_type_hints

Model = TypeVar("Model")

type_hints = functools.cache(get_type_hints)


def read(model: type[Model], document: object) -> Model:
    """The JSON `document` as an object of the dataclass.

    Names that it does not know are left out: a newer service may tell more.

    Raises
    ------
    ValueError
        When something is missing or has another form.
    """
    try:
        return cast(Model, _value(model, document))
    except (KeyError, TypeError, AttributeError, StopIteration) as error:
        raise ValueError(f"The answer is no {model.__name__}: {error!r}.") from error


def _value(hint: Any, value: Any) -> Any:
    if dataclasses.is_dataclass(hint):
        return _object(hint, value)
    arguments = get_args(hint)
    match get_origin(hint):
        case origin if origin in (Union, UnionType):
            return _choice(arguments, value)
        case origin if origin is list:
            return [_value(arguments[0], each) for each in value]
        case origin if origin is tuple:
            return tuple(_value(kind, each) for kind, each in zip(arguments, value, strict=True))
        case origin if origin is dict:
            return {key: _value(arguments[1], each) for key, each in value.items()}
    return value


def _choice(kinds: tuple[Any, ...], value: Any) -> Any:
    """Of the one kind that is not null, or of the first dataclass whose marks the value has."""
    if value is None and NoneType in kinds:
        return None
    others = [kind for kind in kinds if kind is not NoneType]
    return _value(
        others[0] if len(others) == 1 else next(kind for kind in others if _has_marks(kind, value)), value
    )


def _has_marks(kind: Any, value: dict[str, Any]) -> bool:
    """Whether the value has all that the kind needs, and its literals."""
    hints = type_hints(kind)
    return all(
        (
            each.default is not dataclasses.MISSING
            if _name(each) not in value
            else _fits(hints[each.name], value[_name(each)])
        )
        for each in dataclasses.fields(kind)
    )


def _fits(hint: Any, value: Any) -> bool:
    return get_origin(hint) is not Literal or value in get_args(hint)


def _object(kind: Any, value: dict[str, Any]) -> Any:
    hints = type_hints(kind)
    return kind(
        **{
            each.name: _value(hints[each.name], value[_name(each)])
            for each in dataclasses.fields(kind)
            if _name(each) in value
        }
    )


def _name(field: "dataclasses.Field[Any]") -> str:
    """Its name in JSON; a name that Python keeps for itself has an underscore."""
    return field.name.rstrip("_")
