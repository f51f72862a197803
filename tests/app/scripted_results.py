"""Results that scripted operations answer with; their notices carry back what was asked."""

from typing import Any

from services.contract.images import Encoding
from services.contract.layout import ModelDocument
from services.contract.rectify import RectifyParameters

CREASED_SHEET: dict[str, object] = {
    "type": "mesh",
    "rows": 3,
    "columns": 2,
    "points": [[(1.5, 2.0), (8.0, 2.5)], [(1.0, 5.0), (8.5, 5.0)], [(1.5, 8.0), (8.0, 8.5)]],
    "normals": [[(0.0, 0.6, 0.8)], [(0.0, -0.6, 0.8)]],
}


def document(parameters: RectifyParameters, encoding: Encoding, image: str | None) -> dict[str, object]:
    """A `RectifyResult` whose notices carry the options back."""
    return {
        "kind": "planar",
        "evidence": {
            "major_convergence": 0.01,
            "minor_convergence": None,
            "text_area_fraction": 0.4,
            "source": ["text"],
            "outline_confidence": None,
            "sides_seen": 0,
            "print_kept": 1.0,
            "flatness_error_percent": 0.12,
        },
        "camera": {
            "focal_length_px": parameters.focal_length_px,
            "field_of_view_deg": None,
            "source": "given",
            "principal_point": (9.5, 4.5),
            "principal_point_source": "centre",
            "name": parameters.camera,
            "page_focal_length_px": None if parameters.camera is None else 25.0,
            "page_focal_deviation": None if parameters.camera is None else 0.02,
        },
        "surface": {"type": "plane", "normal": (0.0, 0.0, 1.0)},
        "photo": {"width": 40, "height": 30},
        "corners": [(1.0, 1.0), (39.0, 1.5), None, (1.0, 29.0)],
        "orientation": {"rotation_deg": 180, "mirrored": False, "confidence": 0.9},
        "width": 20,
        "height": 10,
        "mesh": {"rows": 2, "columns": 2, "source": [[(0.0, 0.0), (19.0, 0.0)], [(0.0, 9.0), (19.0, 9.0)]]},
        "warnings": [
            {"code": "options", "detail": repr(parameters)},
            {"code": "encoding", "detail": repr(encoding)},
        ],
        "timings_ms": {"decode": 1.25, "texture_flow": 20.0},
        "image": image,
        "image_media_type": None if image is None else "image/jpeg",
    }


def mosaic_document(photos: int, asked: dict[str, object], image: str | None) -> dict[str, object]:
    """A `MosaicResult` whose notices carry back what was asked; the last photo is not placed."""
    mesh = {"rows": 2, "columns": 2, "target": [[(0.0, 0.0), (19.0, 0.0)], [(0.0, 9.0), (19.0, 9.0)]]}
    placed = {"placed": True, "mesh": mesh, "scale": 1.25, "sharpness": 1.0, "covered_fraction": 0.0}
    return {
        "width": 20,
        "height": 10,
        "base": 0,
        "orientation": {"rotation_deg": 90, "mirrored": False, "confidence": None},
        "patches": [placed] * (photos - 1)
        + [{"placed": False, "mesh": None, "scale": None, "sharpness": None, "covered_fraction": None}],
        "pairs": [
            {
                "a": 0,
                "b": 1,
                "matches": 900,
                "votes": 400,
                "runner_up_votes": 12,
                "overlap_fraction": 0.2,
                "residual_px": 0.07,
            }
        ],
        "unplaced": [photos - 1],
        "warnings": [{"code": name, "detail": repr(what)} for name, what in asked.items()],
        "timings_ms": {"decode": 1.25, "block_matches": 20.0},
        "image": image,
        "image_media_type": None if image is None else "image/jpeg",
    }


def layout_document(
    page: dict[str, Any], models: list[ModelDocument], labels: list[str], asked: dict[str, object]
) -> dict[str, object]:
    """A `LayoutResult` by the first model, whose notices carry back what was asked; the first zone has its label."""
    classes = [
        {"name": model.name, "model_version": model.version, "cost": 1.5, "probability": 0.75 / len(models)}
        for model in models
    ]
    measured = {
        "lines": 1,
        "font_size": None,
        "font_class": "normal",
        "line_spacing": None,
        "weight": None,
        "alignment": "left",
        "appearance": None,
        "text": "print",
        "content": {"date": 0.5},
    }
    found = [
        {
            "id": str(zone["id"]),
            "box": zone["box"],
            "label": labels[0] if labels and index == 0 else None,
            "confidence": 0.9,
            "group": None,
            "order": index,
            "kind": "text",
            **measured,
        }
        for index, zone in enumerate(page["zones"])
    ]
    match = {
        "cost": 1.5,
        "node_cost": 1.0,
        "edge_cost": 0.25,
        "count_cost": 0.25,
        "optimal": True,
        "gap": 0.0,
        "backbone": {"sender": "z1"},
        "explanation": None,
    }
    return {
        "width": page["width"],
        "height": page["height"],
        "class": classes[0] if classes else None,
        "classes": classes,
        "unknown_probability": 0.25 if classes else 0.0,
        "zones": found,
        "match": match if classes else None,
        "warnings": [{"code": name, "detail": repr(what)} for name, what in asked.items()],
        "timings_ms": {"decode": 1.25, "match": 2.0},
    }
