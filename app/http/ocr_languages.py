"""The language that a request wants its pages to be read in."""

from app.settings import Settings
from services.errors import InvalidOption


def chosen_language(asked: str | None, settings: Settings) -> str | None:
    """The language to read: `asked`, else the first of OCR_LANGUAGES; None: the worker's default.

    Raises
    ------
    InvalidOption
        When OCR_LANGUAGES does not have it. Workers check whether it is installed.
    """
    allowed = settings.ocr_languages
    if not asked:
        return allowed[0] if allowed else None
    refused = [name for name in asked.split("+") if allowed and name not in allowed]
    if refused:
        raise InvalidOption(
            f"language: {', '.join(refused)} is not read by this server; OCR_LANGUAGES has {', '.join(allowed)}.",
            "language",
        )
    return asked
