"""Opening a database: migrations, what is refused, and how connections are set up."""

import shutil
import sqlite3
import threading
from collections.abc import Callable
from datetime import timedelta
from pathlib import Path

import pytest
from alembic import command
from alembic.autogenerate import compare_metadata
from alembic.runtime.migration import MigrationContext
from sqlalchemy import bindparam, inspect, select, text

from models import migrations, session
from models.documents import digest_document, encode_document
from models.errors import StoreTooNew, StoreUnavailable
from models.feedback_records import FeedbackDraft, ModelChange
from models.records import ModelSettings
from models.repository import Store
from models.tables import ModelRow, StateRow, Table, UtcDateTime
from tests.models.conftest import Clock
from tests.models.databases import filled


def test_migrations_lead_to_the_tables_that_are_mapped(fresh: Callable[[], Path | str]) -> None:
    engine = session.open_engine(fresh())
    session.upgrade_schema(engine)
    with engine.connect() as connection:
        context = MigrationContext.configure(connection, opts={"compare_type": True})
        assert compare_metadata(context, Table.metadata) == []
        names = set(inspect(connection).get_table_names())
    engine.dispose()
    assert names == {*Table.metadata.tables, "alembic_version"}


def test_foreign_keys_and_names_of_constraints_are_those_mapped(tmp_path: Path) -> None:
    """What the comparison above does not look at on SQLite."""

    def described(tables: list[tuple[str]]) -> set[str]:
        # SQLite puts the name of a table that was made anew in quotes.
        lines = (line.replace('"', "") for (sql,) in tables for line in sql.splitlines())
        return {" ".join(line.split()).rstrip(",") for line in lines}

    migrated, mapped = (session.open_engine(tmp_path / name) for name in ("migrated", "mapped"))
    session.upgrade_schema(migrated)
    Table.metadata.create_all(mapped)
    query = "SELECT sql FROM sqlite_master WHERE sql IS NOT NULL AND name != 'alembic_version'"
    both = []
    for engine in (migrated, mapped):
        with engine.connect() as connection:
            both.append(described([(row[0],) for row in connection.exec_driver_sql(query)]))
        engine.dispose()
    assert both[0] == both[1]


def test_folder_and_file_are_made_and_opened_again(tmp_path: Path) -> None:
    path = tmp_path / "not yet" / "100 % ?" / "store.sqlite3"
    with Store.open(path) as store:
        store.add_version("letter", {"n": 1}, "import")
        store.add_sample("letter", {"zones": []})
    for again in (path, str(path), f"sqlite:///{str(path).replace('%', '%25').replace('?', '%3F')}"):
        with Store.open(again) as store:
            assert store.model("letter").document == {"n": 1}
            assert store.sample_count("letter") == 1
    assert [file.name for file in path.parent.iterdir()] == ["store.sqlite3"]  # the log is folded in


def test_connections_are_set_up_for_many_writers(tmp_path: Path) -> None:
    engine = session.open_engine(tmp_path / "store.sqlite3", busy_timeout_s=1.5)
    told = ("journal_mode", "synchronous", "busy_timeout", "foreign_keys", "trusted_schema")
    with engine.connect() as connection:
        found = [connection.exec_driver_sql(f"PRAGMA {name}").scalar_one() for name in told]
    engine.dispose()
    assert found == ["wal", 2, 1500, 1, 0]


def test_the_database_of_a_newer_release_is_refused_and_left_alone(tmp_path: Path) -> None:
    path = filled(tmp_path / "store.sqlite3")
    with sqlite3.connect(path) as connection:
        connection.execute("UPDATE alembic_version SET version_num = '9999'")
    connection.close()
    before = path.read_bytes()
    with pytest.raises(StoreTooNew, match=r"9999.*newer release"):
        Store.open(path)
    assert path.read_bytes() == before


NEXT_RELEASE = """
import sqlalchemy as sa
from alembic import op

revision = "0099"
down_revision = "{newest}"

def upgrade():
    with op.batch_alter_table("layout_models", recreate="always") as table:
        table.add_column(sa.Column("colour", sa.String(20), nullable=False, server_default="none"))
"""


FIRST_RELEASE = """
INSERT INTO layout_models VALUES (1, 'letter', 2, 2, :now, :now, NULL);
INSERT INTO layout_models VALUES (2, 'memo', NULL, 1, :now, :now, :now);
INSERT INTO layout_model_versions VALUES (1, 1, 'import', 'first', :now, :document);
INSERT INTO layout_model_versions VALUES (1, 2, 'feedback', '', :now, :document);
INSERT INTO layout_model_versions VALUES (2, 1, 'import', '', :now, :document);
INSERT INTO layout_samples VALUES ('01KDYSJ4W8000000000000000A', 1, 'key', :digest, :now, :document);
INSERT INTO layout_samples VALUES ('01KDYSJ4W8000000000000000C', 1, 'later', 'other', :later, :document);
INSERT INTO layout_results VALUES ('01KDYSJ4W8000000000000000B', :now, :later, :document);
UPDATE store_state SET revision = 5
"""


def test_the_database_of_the_first_release_goes_on(fresh: Callable[[], Path | str], clock: Clock) -> None:
    where, document = fresh(), {"n": 1}
    engine = session.open_engine(where)
    values = {
        "now": clock(),
        "later": clock() + timedelta(days=1),
        "document": encode_document(document),
        "digest": digest_document(document),
    }
    with session.writers_of(engine).begin() as connection:
        config = session._alembic_config()
        config.attributes["connection"] = connection
        command.upgrade(config, "0001")
        for statement in FIRST_RELEASE.strip().split(";\n"):
            named = {name: value for name, value in values.items() if f":{name}" in statement}
            moments = [bindparam(name, type_=UtcDateTime) for name in named if name in ("now", "later")]
            connection.execute(text(statement).bindparams(*moments), named)
    engine.dispose()
    with Store.open(where, clock=clock) as store:
        (letter,) = store.models()
        assert (letter.name, letter.version, letter.samples) == ("letter", 2, 2)
        assert letter.settings == ModelSettings()
        assert [version.note for version in store.model_versions("letter")] == ["first", ""]
        sample, later = store.samples("letter")
        assert (sample.after_version, later.after_version) == (0, 2)
        assert store.samples_after("letter", 1) == store.samples_after("letter", 2) == [later.id]
        assert (sample.document, sample.origin, sample.result_id) == (document, "posted", None)
        assert not store.add_sample("letter", document, key="key").created
        result = store.result("01KDYSJ4W8000000000000000B")
        assert (result.document, store.revision()) == (document, 5)
        draft = FeedbackDraft(
            result.id, None, {"told": 1}, {}, "letter", "letter", 3, 1, False, sample={"page": 2}
        )
        kept = store.add_feedback(draft, [ModelChange("letter", {"n": 3}, 2)])
        assert (dict(kept.versions), store.sample_count("letter")) == ({"letter": (2, 3)}, 3)
        assert store.add_version("memo", {}, "import").version == 2
        assert store.change_settings("memo", continues="letter").continues == "letter"
    with Store.open(where, clock=clock) as store:
        assert store.health("letter").feedbacks == 1


def test_a_reader_sees_one_state(where: Path | str) -> None:
    with Store.open(where) as store:
        with store._reading() as reading:
            before = reading.execute(select(StateRow.revision)).scalar_one()
            store.add_version("letter", {}, "import")
            assert reading.execute(select(StateRow.revision)).scalar_one() == before
            assert reading.execute(select(ModelRow)).all() == []
        assert store.revision() > before


def test_a_writer_waits_for_another_no_longer_than_it_says(where: Path | str) -> None:
    with Store.open(where, busy_timeout_s=0.05) as store, Store.open(where) as other:
        with other._changing(), pytest.raises(StoreUnavailable, match="lock"):
            store.add_sample("letter", {})
        assert store.models() == []
        assert store.add_sample("letter", {}).created


def test_a_later_migration_may_make_tables_anew(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A table that others refer to is dropped on the way: their rows stay, and still refer to it."""
    path = filled(tmp_path / "store.sqlite3")
    folder = tmp_path / "migrations"
    (ours,) = migrations.__path__
    shutil.copytree(ours, folder, ignore=shutil.ignore_patterns("__pycache__"))
    newest = max((folder / "versions").glob("v*.py")).name[1:5]
    (folder / "versions" / "v0099_colour.py").write_text(NEXT_RELEASE.replace("{newest}", newest))
    with monkeypatch.context() as patch:
        patch.setattr(migrations, "__path__", [str(folder)])
        with Store.open(path) as store:
            assert store.model("letter").version == len(store.model_versions("letter")) == 20
            assert len(store.samples("letter")) == 20
    with sqlite3.connect(path) as connection:
        assert connection.execute("SELECT name, colour FROM layout_models").fetchall() == [("letter", "none")]
        connection.execute("PRAGMA foreign_keys=ON")
        with pytest.raises(sqlite3.IntegrityError):
            connection.execute("DELETE FROM layout_models")
    connection.close()
    with pytest.raises(StoreTooNew):
        Store.open(path)


def test_a_migration_that_fails_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "store.sqlite3"
    path.touch()

    def fail(*_: object) -> None:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr("alembic.operations.Operations.create_index", fail)
        with pytest.raises(StoreUnavailable, match="No space left"):
            Store.open(path)
    with sqlite3.connect(path) as connection:
        assert connection.execute("SELECT name FROM sqlite_master").fetchall() == []
    connection.close()
    with Store.open(path) as store:
        assert store.models() == []


def test_a_writer_that_waits_too_long_says_so_and_readers_do_not_wait(tmp_path: Path) -> None:
    path = filled(tmp_path / "store.sqlite3")
    other = sqlite3.connect(path, isolation_level=None)
    with Store.open(path, busy_timeout_s=0.05) as store:
        other.execute("BEGIN IMMEDIATE")
        other.execute("DELETE FROM layout_samples")
        with pytest.raises(StoreUnavailable, match="locked"):
            store.add_sample("letter", {"late": True})
        assert store.sample_count("letter") == 20
        other.execute("ROLLBACK")
        assert store.add_sample("letter", {"late": True}).created
    other.close()


def test_threads_that_wait_too_long_say_so(tmp_path: Path) -> None:
    with Store.open(tmp_path / "store.sqlite3", busy_timeout_s=0.05) as store:
        with store._writer_lock.hold(), pytest.raises(StoreUnavailable, match="locked"):
            store.add_result({}, ttl_s=1)
        assert store.add_result({}, ttl_s=1)


class BusyAtFirst:
    """A connection whose switch to the write-ahead log meets another process doing the same."""

    def __init__(self, refusals: int, code: int) -> None:
        self.refusals = refusals
        self.code = code

    def execute(self, _: str) -> None:
        if self.refusals:
            self.refusals -= 1
            error = sqlite3.OperationalError("no")
            error.sqlite_errorcode = self.code
            raise error


def test_the_switch_to_the_log_is_tried_again_only_while_others_are_in_the_way() -> None:
    busy = BusyAtFirst(3, sqlite3.SQLITE_BUSY_RECOVERY)
    session._enter_wal(busy, timeout_s=30)  # type: ignore[arg-type]
    assert busy.refusals == 0
    for refused, timeout_s in (
        (BusyAtFirst(3, sqlite3.SQLITE_BUSY), 0),
        (BusyAtFirst(3, sqlite3.SQLITE_FULL), 30),
    ):
        with pytest.raises(sqlite3.OperationalError):
            session._enter_wal(refused, timeout_s)  # type: ignore[arg-type]
        assert refused.refusals == 2


def test_threads_share_a_store(tmp_path: Path) -> None:
    failures: list[BaseException] = []

    def work(number: int) -> None:
        try:
            for step in range(5):
                store.add_version("letter", {"thread": number, "step": step}, "train")
                store.add_sample("letter", {"thread": number, "step": step})
                store.ready_models()
        except BaseException as error:
            failures.append(error)

    with Store.open(tmp_path / "store.sqlite3") as store:
        store.add_version("letter", {}, "import")
        threads = [threading.Thread(target=work, args=(number,)) for number in range(12)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert failures == []
        assert store.model("letter").version == 61
        assert store.sample_count("letter") == 60
