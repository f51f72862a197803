"""Requests and responses of /layout/models/{name}/settings and /layout/models/{name}/health."""

from collections.abc import Mapping
from typing import Annotated, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from app.schemas.layout_models import Health, NameInBody
from app.schemas.options import Written
from services.contract.answers.page import Answer
from services.contract.bounded_patterns import LONGEST_PATTERN, UnboundedPattern, compile_bounded
from services.contract.fields import MOST_FIELDS, DateOrder, DecimalSign, FieldSetting, FieldType
from services.contract.html import HtmlElement
from services.contract.layout import LONGEST_LABEL
from services.contract.layout_learning import Learner

Region = Annotated[str, Written("^[A-Z]{2}$", "two capitals, as US")]
Language = Annotated[str, Written("^[a-z]{2,3}$", "two or three small letters, as en")]
Currency = Annotated[str, Written("^[A-Z]{3}$", "three capitals, as EUR")]
LabelName = Annotated[str, Field(min_length=1, max_length=LONGEST_LABEL)]


class TypedField(BaseModel):
    """The type of the value of a label. Options that a type does not use are refused."""

    model_config = ConfigDict(extra="forbid", strict=True)

    type: FieldType
    pattern: Annotated[str, Field(min_length=1, max_length=LONGEST_PATTERN)] | None = Field(
        default=None,
        description="For `pattern`: a regular expression with bounded repetitions. Its first group is the value, else "
        "the whole match.",
    )
    order: DateOrder | None = Field(default=None, description="For `date`: the order of numeric dates.")
    languages: Annotated[list[Language], Field(max_length=12)] = Field(
        default=[],
        description="For `date`: languages of the names of months (ISO 639-1). Default: en, de, fr, es, it, nl, pt.",
    )
    region: Region | None = Field(
        default=None,
        description="For `postal-code` and `phone`: the country (ISO 3166-1, two letters) of codes, and of numbers "
        "without a country code.",
    )
    currency: Currency | None = Field(
        default=None,
        description="For `amount`: the currency (ISO 4217) of numbers without one, and of signs of several.",
    )
    decimal: DecimalSign | None = Field(
        default=None, description="For `amount`: the decimal sign; default: it follows from the digits."
    )

    @model_validator(mode="after")
    def _fits_its_type(self) -> Self:
        used = _OPTIONS.get(self.type, ())
        for name in type(self).model_fields.keys() - {"type", *used}:
            if getattr(self, name):
                raise ValueError(f"{name}: fields of type {self.type} do not have this option")
        if self.type == "pattern":
            try:
                compile_bounded(self.pattern or "")
            except UnboundedPattern as error:
                raise ValueError(f"pattern: {error}") from error
            if self.pattern is None:
                raise ValueError("pattern: send the regular expression of the value")
        if self.type == "postal-code" and self.region is None:
            raise ValueError("region: send the country of the postal codes, for example US")
        return self

    def setting(self) -> FieldSetting:
        """The same as the value that the store and the workers use."""
        return FieldSetting(**{**self.model_dump(), "languages": tuple(self.languages)})


_OPTIONS: Mapping[FieldType, tuple[str, ...]] = {
    "date": ("order", "languages"),
    "amount": ("currency", "decimal"),
    "phone": ("region",),
    "postal-code": ("region",),
    "pattern": ("pattern",),
}


class Settings(Answer):
    """Settings of a model. They do not belong to a version."""

    learner: Learner = Field(description="Learning method for feedback and training.")
    genre: str | None = Field(description="The genre of the class; null: chosen by similarity.")
    continues: str | None = Field(
        description="The class whose later pages this model describes; null: it describes first pages."
    )
    fields: dict[str, TypedField] = Field(
        default={}, description="Types of the fields, by label; other labels are text."
    )
    elements: dict[str, HtmlElement] = Field(
        default={},
        description="Elements of HTML files, by label; those of other labels follow from their names.",
    )


class SettingsBody(BaseModel):
    """The settings to change; absent ones keep their values."""

    model_config = ConfigDict(extra="forbid", strict=True)

    learner: Learner | None = Field(default=None, description="null: the service's default.")
    genre: NameInBody | None = None
    continues: NameInBody | None = None
    fields: Annotated[dict[LabelName, TypedField | None], Field(max_length=MOST_FIELDS)] | None = Field(
        default=None,
        description="Types of the fields, by label. The given labels change, null removes one, and the others stay; "
        "null instead of the object removes all.",
    )
    elements: Annotated[dict[LabelName, HtmlElement | None], Field(max_length=MOST_FIELDS)] | None = Field(
        default=None,
        description="Elements of HTML files, by label, which change as `fields`. ul, ol: every line is an item. "
        "figure, img: the zone is cut out of the picture. figcaption: the caption of the figure next to it. none: left "
        "out.",
    )


class ModelHealthReport(Health):
    """Error rates of one model, with its name."""

    name: str
