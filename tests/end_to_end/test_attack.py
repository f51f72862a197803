"""The quick rows of the attack table, against the product."""

import httpx
import pytest

from benchmarks.attack.row import Attack
from benchmarks.attack.table import ATTACKS

QUICK = [row for row in ATTACKS if row.is_quick and not row.environment]


@pytest.mark.parametrize("row", QUICK, ids=[row.name for row in QUICK])
def test_an_attack_is_answered_as_it_must_be(service: httpx.Client, row: Attack) -> None:
    answer = row.send(str(service.base_url).rstrip("/"))
    assert answer.code in row.codes, answer
    assert service.get("/health/live").status_code == 200


def test_names_are_unique() -> None:
    assert len({row.name for row in ATTACKS}) == len(ATTACKS)
