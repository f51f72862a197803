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
