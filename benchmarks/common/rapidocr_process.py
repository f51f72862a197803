"""Reads page pictures named on stdin, one a line; answers a JSON line of [text, confidence] for each.

Started by `benchmarks.common.reading.RapidOcrReader` in an environment that has `rapidocr` and `onnxruntime`; it
imports nothing of this project.
"""

import importlib
import json
import logging
import sys


def main() -> None:
    """Until stdin ends."""
    rapidocr = importlib.import_module("rapidocr")
    logging.disable(logging.WARNING)
    engine = rapidocr.RapidOCR(
        params={
            "EngineConfig.onnxruntime.intra_op_num_threads": 1,
            "EngineConfig.onnxruntime.inter_op_num_threads": 1,
            # Pages are large: the default limit would shrink their text below legibility.
            "Det.limit_side_len": 2000,
            "Det.limit_type": "max",
            "Global.max_side_len": 4000,
        }
    )
    answers = sys.stdout
    # Whatever the library prints must not get among the answers.
    sys.stdout = sys.stderr
    for line in sys.stdin:
        result = engine(line.strip())
        found = zip(result.txts or (), result.scores or (), strict=True)
        print(json.dumps([(text, float(score)) for text, score in found]), file=answers, flush=True)


if __name__ == "__main__":
    main()
