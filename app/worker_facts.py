"""What workers reported of themselves after their warm-up."""

from app.engine.base import EngineStatus


def languages_of(status: EngineStatus) -> list[str]:
    """Languages that the workers' OCR reads, by Tesseract's names."""
    languages = status.facts.get("languages")
    return [str(language) for language in languages] if isinstance(languages, list | tuple) else []
