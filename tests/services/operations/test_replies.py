"""What leaves a worker is JSON's."""

import numpy as np

from services.operations.replies import to_json_ready


def test_json_ready_values_keep_their_kind() -> None:
    mixed = {
        "a": np.int64(3),
        "b": (np.bool_(True), np.float32(0.5)),
        4: np.array([[1, 2]]),
        "c": [None, "x"],
    }
    assert to_json_ready(mixed) == {"a": 3, "b": [True, 0.5], "4": [[1, 2]], "c": [None, "x"]}
    assert type(to_json_ready(np.float64(1.5))) is float


def test_unknown_numbers_of_an_array_become_null() -> None:
    mesh = np.array([[[1.0, np.nan]], [[np.inf, 2.5]]])
    assert to_json_ready({"mesh": mesh}) == {"mesh": [[[1.0, None]], [[None, 2.5]]]}
    assert to_json_ready(np.array([0.25, 4.0], np.float32)) == [0.25, 4.0]
