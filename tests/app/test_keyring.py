"""Keys of both sources, a file of keys that changes, and tokens that a key makes."""

import asyncio
import os
import signal
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import httpx
import pytest

from app.access import keyring as keyring_module
from app.access.keyring import Keyring
from app.access.known_keys import known_keys
from app.access.tokens import InvalidToken, Tokens
from app.roles import InvalidKeys, Key, digest_of_key
from models.records import CLOCKS_DIFFER_S
from tests.app.serving import POLL_S, serving
from tests.app.test_problems import assert_problem

ANNA = "anna admin " + digest_of_key(b"key-of-anna")
RITA = "rita reader " + digest_of_key(b"key-of-rita")


def write(path: Path, *lines: str) -> Path:
    path.write_text("".join(line + "\n" for line in lines))
    return path


def names(keyring: Keyring) -> set[str]:
    return {key.name for key in keyring.keys.values()}


@pytest.mark.parametrize("lines", [(), ("",), ("# rita reader", "  ")])
def test_a_file_without_a_key_is_refused(tmp_path: Path, lines: tuple[str, ...]) -> None:
    with pytest.raises(InvalidKeys, match="holds no key"):
        known_keys((), write(tmp_path / "keys", *lines))


def test_the_same_key_twice_is_refused(tmp_path: Path) -> None:
    path = write(tmp_path / "keys", RITA, ANNA, RITA.replace("rita reader", "boss admin"))
    with pytest.raises(InvalidKeys, match=r"line 3 .* as rita"):
        known_keys((), path)
    path = write(tmp_path / "keys", RITA, ANNA)
    for entries in (("key-of-rita",), ("old:key-of-rita",), ("phone:secret", "secret"), ("same", "same")):
        with pytest.raises(InvalidKeys, match="the same key is there twice"):
            known_keys(entries, path)
    assert len(known_keys(("phone:secret",), path)) == 4  # with and without its name


@pytest.mark.parametrize("entry", ["admin:", "first entry:", "1:", ":"])
def test_an_entry_with_an_empty_key_is_refused(entry: str) -> None:
    with pytest.raises(InvalidKeys, match="entry 2 of API_KEYS has nothing behind its colon"):
        known_keys(("phone:secret", entry), None)


def test_short_keys_are_told_without_the_key(caplog: pytest.LogCaptureFixture) -> None:
    Keyring(("phone:secret", "sesame", "tablet:" + "k" * 16, "k" * 17), None)
    (told,) = caplog.messages
    assert "less than 16 characters" in told
    assert told.endswith("entry 1 (phone), entry 2")
    assert "secret" not in told
    assert "sesame" not in told


def test_a_file_that_cannot_be_read_is_refused(tmp_path: Path) -> None:
    for content in (b"\xff\xfe", b"#" * (2 << 20)):
        (tmp_path / "keys").write_bytes(content)
        with pytest.raises(InvalidKeys, match="API_KEYS_FILE"):
            known_keys((), tmp_path / "keys")
    with pytest.raises(InvalidKeys, match="cannot be read"):
        known_keys((), tmp_path / "nothing")


def test_the_name_admin_is_a_role_of_api_keys_only(tmp_path: Path) -> None:
    path = write(tmp_path / "keys", "admin verifier " + digest_of_key(b"key-of-vera"))
    keys = known_keys(("admin:root", "phone:secret"), path)
    roles = {key: keys[digest_of_key(key.encode())].role for key in ("root", "secret", "key-of-vera")}
    assert roles == {"root": "admin", "secret": None, "key-of-vera": "verifier"}


def look(keyring: Keyring) -> None:
    """Two looks at the file: one that changed less than a second ago counts when it is the same at the second."""
    keyring.read_again()
    keyring.read_again()


def test_a_changed_file_is_taken_over_and_an_invalid_one_is_not(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = write(tmp_path / "keys", RITA)
    keyring = Keyring((), path)
    write(path, RITA, ANNA)
    look(keyring)
    assert names(keyring) == {"rita", "anna"}
    for wrong in ((), ("nonsense",), (RITA, RITA)):
        write(path, *wrong)
        look(keyring)
        look(keyring)  # the same file is told once
        assert names(keyring) == {"rita", "anna"}
    path.unlink()
    look(keyring)
    assert names(keyring) == {"rita", "anna"}
    told = [record for record in caplog.records if "cannot be used" in record.message]
    assert [record.levelname for record in told] == ["ERROR"] * 4
    write(tmp_path / "new", ANNA).replace(path)
    look(keyring)
    assert names(keyring) == {"anna"}


def test_a_file_that_is_being_written_is_not_taken_over(tmp_path: Path) -> None:
    path = write(tmp_path / "keys", RITA, ANNA)
    keyring = Keyring((), path)
    write(path, RITA)  # the first half
    assert not keyring.read_again()
    write(path, RITA, RITA.replace("rita", "tina").replace("0", "1"))
    assert not keyring.read_again()
    assert names(keyring) == {"rita", "anna"}
    assert keyring.read_again()
    assert names(keyring) == {"rita", "tina"}
    assert not keyring.read_again()
    old = time.time_ns() - 2 * keyring_module.SETTLED_NS
    os.utime(write(path, ANNA), ns=(old, old))
    assert keyring.read_again()  # nobody writes it any more
    assert names(keyring) == {"anna"}


def test_a_file_that_changes_while_it_is_read_is_not_taken_over(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level("INFO")
    path = write(tmp_path / "keys", RITA)
    keyring = Keyring((), path)

    def read_and_write(*arguments: Any) -> Mapping[str, Key]:
        monkeypatch.undo()
        found = known_keys(*arguments)
        write(path, RITA, ANNA)
        return found

    monkeypatch.setattr(keyring_module, "known_keys", read_and_write)
    write(path, ANNA)
    assert keyring.read_again(is_asked=True)
    assert names(keyring) == {"rita"}
    look(keyring)
    assert names(keyring) == {"rita", "anna"}
    assert [("while it was read" in each, "were read again" in each) for each in caplog.messages] == [
        (True, False),
        (False, True),
    ]


def test_many_signals_lead_to_one_reading_a_second(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Here the pause is longer than the test, so that the first of the signals alone has led to a reading."""
    monkeypatch.setattr(keyring_module, "ASKED_EVERY_S", 3600.0)
    keyring = Keyring((), write(tmp_path / "keys", RITA))
    readings: list[bool] = []
    monkeypatch.setattr(keyring, "read_again", lambda *, is_asked: readings.append(is_asked) or True)

    async def storm() -> None:
        async with keyring.watched():
            for _ in range(200):
                os.kill(os.getpid(), signal.SIGHUP)
                await asyncio.sleep(0)
            while not readings:
                await asyncio.sleep(0)
            for _ in range(200):
                os.kill(os.getpid(), signal.SIGHUP)
                await asyncio.sleep(0)

    asyncio.run(storm())
    assert readings == [True]


def test_a_file_that_is_put_in_place_with_the_same_time_and_size_counts(tmp_path: Path) -> None:
    path = write(tmp_path / "keys", RITA)
    keyring, before = Keyring((), path), path.stat()
    new = write(tmp_path / "new", RITA.replace("rita", "tina"))
    os.utime(new, ns=(before.st_atime_ns, before.st_mtime_ns))
    new.replace(path)
    look(keyring)
    assert names(keyring) == {"tina"}


def test_a_service_takes_a_changed_file_over(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Within 5 s in the product; here the pause is shorter. Tokens of a key that is gone are worth nothing."""
    assert keyring_module.WATCH_EVERY_S < 5
    monkeypatch.setattr(keyring_module, "WATCH_EVERY_S", 0.05)
    path = write(tmp_path / "keys", RITA, ANNA)
    with serving(api_keys_file=path) as client:
        token = client.post("/tokens", headers={"X-API-Key": "key-of-rita"}).json()["token"]
        assert client.get("/layout/models", params={"token": token}).status_code == 200
        write(path, ANNA)
        until_refused(client, "key-of-rita")
        assert_problem(client.get("/layout/models", params={"token": token}), 403, "forbidden")
        assert client.get("/layout/models", headers={"X-API-Key": "key-of-anna"}).status_code == 200


def until_refused(client: httpx.Client, key: str) -> None:
    deadline = time.monotonic() + 20
    while client.get("/layout/models", headers={"X-API-Key": key}).status_code == 200:
        assert time.monotonic() < deadline
        time.sleep(POLL_S)


def test_tokens() -> None:
    now_s, key, other = 1000.5, Key("rita", "reader", "00" * 32), Key("anna", "admin", "11" * 32)

    def tokens(secret: bytes = b"secret", ttl_s: int = 60, at_s: float = now_s) -> Tokens:
        made = Tokens(ttl_s, lambda: at_s)
        made.use(secret)
        return made

    token, expires_s = tokens().make(key)
    assert expires_s == 1060
    assert tokens().key_of(token, [other, key]) == key
    with pytest.raises(InvalidToken, match="expired"):
        tokens(at_s=1060).key_of(token, [key])
    forged = (
        tokens(secret=key.digest.encode()).make(key)[0],  # by a line of the file
        tokens(secret=bytes.fromhex(key.digest)).make(key)[0],
        tokens(secret=b"").make(key)[0],
        tokens(at_s=now_s + 60 + CLOCKS_DIFFER_S).make(key)[0],  # valid for longer than tokens are
        tokens(ttl_s=1 << 30).make(key)[0],
        tokens().make(Key("rita", "reader", "22" * 32))[0],
    )
    for broken in (token[:-2], token[1:], token + "A" * 8, "", "ü", *forged):
        with pytest.raises(InvalidToken, match="not valid"):
            tokens().key_of(broken, [other, key])
    with pytest.raises(InvalidToken, match="not valid"):
        Tokens(60, lambda: now_s).key_of(tokens(secret=b"").make(key)[0], [key])  # before the store is open


def test_processes_share_the_secret(tmp_path: Path) -> None:
    first = {"X-API-Key": "first"}
    settings = {"api_keys": "first,second", "data_dir": tmp_path}
    with serving(**settings) as one, serving(**settings) as another:
        token = one.post("/tokens", headers=first).json()["token"]
        assert another.get("/layout/models", params={"token": token}).status_code == 200
