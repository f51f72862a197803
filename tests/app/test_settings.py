"""Settings come from the environment, with units in their names."""

from pathlib import Path

import pytest
from pydantic import ValidationError

from app.processors import usable_workers
from app.settings import Settings


def test_defaults() -> None:
    settings = Settings()
    assert (settings.host, settings.port, settings.workers) == ("127.0.0.1", 8000, usable_workers())
    assert settings.api_keys == ()
    assert settings.data_dir == Path("data")
    assert settings.database_url == ""


def test_the_environment_sets_them(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in {"PORT": "9000", "API_KEYS": "a, b", "JOB_TIMEOUT_S": "2.5", "WORKERS": "3"}.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setenv("DATA_DIR", "/somewhere/else")
    monkeypatch.setenv("DATABASE_URL", "postgresql://someone:secret-word@host/layout")
    assert Settings().data_dir == Path("/somewhere/else")
    assert Settings().database_url == "postgresql://someone:secret-word@host/layout"
    assert "secret-word" not in repr(Settings())
    settings = Settings()
    assert (settings.port, settings.api_keys, settings.job_timeout_s, settings.workers) == (
        9000,
        ("a", "b"),
        2.5,
        3,
    )


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("PORT", "70000"),
        ("WORKERS", "-1"),
        ("QUEUE_LENGTH", "-1"),
        ("JOB_TIMEOUT_S", "0"),
        ("MAX_UPLOAD_BYTES", "many"),
        ("MAX_MOSAIC_UPLOAD_BYTES", "0"),
        ("MAX_MOSAIC_MEGAPIXELS", "-1"),
        ("MOSAIC_TIMEOUT_S", "0"),
        ("LOG_LEVEL", "LOUD"),
        ("MODEL_TIMEOUT_S", "0"),
        ("RESULT_TTL_S", "0"),
        ("MAX_RESULTS", "0"),
        ("MAX_MODELS", "none"),
        ("MAX_SAMPLES_PER_MODEL", "0"),
        ("MAX_ZONES", "0"),
        ("MAX_ZONES_BYTES", "1"),
        ("MAX_ZONES_FILE_BYTES", "1"),
        ("MAX_MODEL_BYTES", "1"),
        ("JOB_TTL_S", "0"),
        ("MAX_JOBS", "0"),
        ("MAX_JOB_RESULT_BYTES", "1"),
        ("MAX_JOB_LISTENERS", "0"),
    ],
)
def test_nonsense_is_refused(monkeypatch: pytest.MonkeyPatch, name: str, value: str) -> None:
    monkeypatch.setenv(name, value)
    with pytest.raises(ValidationError, match=name.lower()):
        Settings()


def test_every_setting_says_what_it_is() -> None:
    assert all(field.description for field in Settings.model_fields.values())


def test_keys_stay_out_of_logs() -> None:
    assert "secret" not in repr(Settings(api_keys=("secret",)))
