"""Example documents that several operations of the OpenAPI document show."""

WHEN = "2026-11-22T09:30:00Z"
RESULT = "01M7ZZQ4ZN38G37138FEXHE2T7"
SAMPLE = "01M80AWXT7S4QAHS1WR3QVD0RK"
JOB = "5f0c8a3be1d94d0f8a7b6c5d4e3f2a1b"
TIMINGS = {"decode": 42.0, "texture_flow": 310.2}
ORIENTATION = {
    "rotation_deg": 0,
    "mirrored": False,
    "confidence": 0.95,
    "photo_rotation_deg": 1.4,
}
CORNERS = [[[102.3, 88.1], [2207.9, 95.4]], [[96.0, 3010.2], [2215.5, 3002.8]]]
PAGE = {
    "width": 1240,
    "height": 1754,
    "zones": [{"id": "z1", "box": [140, 345, 388, 390], "label": "receiver", "text": "Mr. A. Smith"}],
}
CLASS = {"name": "letter", "model_version": 7, "cost": 12.4, "probability": 0.97}
ZONE = {
    "id": "z1",
    "box": [140.0, 345.0, 388.0, 390.0],
    "label": "receiver",
    "confidence": 0.93,
    "group": None,
    "order": 0,
    "kind": "text",
    "lines": 4,
    "font_size": 34.0,
    "font_class": "normal",
    "line_spacing": 48.2,
    "weight": 0.11,
    "alignment": "left",
    "appearance": {
        "density": 0.26,
        "size": 1.05,
        "size_spread": 0.35,
        "stroke": 0.98,
        "slant": 0.02,
        "regularity": 0.94,
    },
    "text": "Mr. A. Smith",
    "content": {"name": 0.9},
}
LAYOUT = {
    "id": RESULT,
    "file_name": "scan-0412.jpg",
    "width": 1240,
    "height": 1754,
    "class": CLASS,
    "classes": [CLASS],
    "unknown_probability": 0.03,
    "zones": [ZONE],
    "match": {
        "cost": 12.4,
        "node_cost": 7.9,
        "edge_cost": 4.1,
        "count_cost": 0.4,
        "optimal": True,
        "gap": 0.0,
        "backbone": {"receiver": "z1"},
        "explanation": None,
    },
    "part": "first",
    "document_class": "letter",
    "page": None,
    "image": {"width": 1240, "height": 1754, "bytes": 181204},
    "decision": {"action": "accept", "tolerated_error": 0.01, "reasons": []},
    "warnings": [],
    "timings_ms": {"decode": 18.0, "match": 21.4},
}
FLAT = {
    "photo": {"width": 2304, "height": 3072},
    "corners": [[96.2, 80.4], [2210.1, 88.9], [2219.8, 3010.5], None],
    "orientation": ORIENTATION,
    "width": 2307,
    "height": 2968,
    "mesh": {"rows": 2, "columns": 2, "source": CORNERS},
}
RECTIFIED = {
    "kind": "planar",
    "evidence": {
        "major_convergence": 0.0019,
        "minor_convergence": 0.0016,
        "text_area_fraction": 0.31,
        "source": ["text"],
        "outline_confidence": None,
        "sides_seen": 0,
        "print_kept": 1.0,
        "flatness_error_percent": 0.12,
    },
    "camera": {
        "focal_length_px": 2503.4,
        "field_of_view_deg": 68.7,
        "source": "estimated",
        "principal_point": [1151.5, 1535.5],
        "principal_point_source": "centre",
    },
    "surface": {"type": "plane", "normal": [0.47, 0.21, 0.86]},
    **FLAT,
    "warnings": [],
    "timings_ms": TIMINGS,
    "image": None,
    "image_media_type": None,
}
MOSAIC = {
    "width": 2480,
    "height": 3508,
    "base": 0,
    "orientation": ORIENTATION,
    "patches": [
        {
            "placed": True,
            "mesh": {"rows": 2, "columns": 2, "target": CORNERS},
            "scale": 1.04,
            "sharpness": 1.0,
            "covered_fraction": 0.05,
        },
        {"placed": False, "mesh": None, "scale": None, "sharpness": None, "covered_fraction": None},
    ],
    "pairs": [
        {
            "a": 0,
            "b": 1,
            "matches": 68,
            "votes": 12,
            "runner_up_votes": 9,
            "overlap_fraction": 0.21,
            "residual_px": 0.07,
        }
    ],
    "unplaced": [1],
    "warnings": [{"code": "unplaced", "detail": "images[1] overlaps the other photos too little."}],
    "timings_ms": {"decode": 161.0, "registration": 900.4},
    "image": None,
    "image_media_type": None,
}
ACCEPTED = {
    "id": JOB,
    "state": "queued",
    "stage": None,
    "progress": 0.0,
    "attempts": 0,
    "created": WHEN,
    "started": None,
    "ended": None,
    "problem": None,
    "links": {"result": f"/jobs/{JOB}/result", "events": f"/jobs/{JOB}/events"},
    "poll_after_s": 1,
    "callback_url": None,
    "deliveries": list[str](),
}
HEALTH = {
    "feedbacks": 60,
    "recent": 50,
    "recent_zone_error": 0.012,
    "recent_class_error": 0.0,
    "recent_text_error": 0.0,
    "earlier_zone_error": 0.034,
    "last_feedback": WHEN,
}
FOUND = {"found": "letter", "verified": "letter"}
DATE = {
    "type": "date",
    "pattern": None,
    "order": "MDY",
    "languages": ["en"],
    "region": None,
    "currency": None,
    "decimal": None,
}
SETTINGS = {
    "learner": "passive-aggressive",
    "genre": None,
    "continues": None,
    "fields": {"date": DATE},
    "elements": {"subject": "h1"},
}
VERSIONS = {"name": "letter", "old_version": 7, "new_version": 8}
MODEL = {
    "format": "layout-graph-model",
    "format_version": 1,
    "name": "letter",
    "nodes": [{"label": None}, {"label": "receiver"}],
}
RECEIPT = {"id": SAMPLE, "model": "letter", "zones": 1, "labels": {"receiver": 1}}
IMPORTED = {"name": "letter", "version": 8, "labels": ["receiver"]}
UNKNOWN = {"id": SAMPLE, "result": RESULT, "created": WHEN}
UPLOAD = {
    "id": RESULT,
    "name": "photo.jpg",
    "length": 8_388_608,
    "offset": 5_242_880,
    "created": WHEN,
    "expires": "2026-11-22T10:00:00Z",
}
