"""Examples of the OpenAPI document: a short real request and response for every operation."""

from collections.abc import Mapping
from typing import Any

_WHEN = "2026-11-22T09:30:00Z"
_RESULT = "01M7ZZQ4ZN38G37138FEXHE2T7"
_SAMPLE = "01M80AWXT7S4QAHS1WR3QVD0RK"
_JOB = "5f0c8a3be1d94d0f8a7b6c5d4e3f2a1b"
_TIMINGS = {"decode": 42.0, "texture_flow": 310.2}
_ORIENTATION = {"rotation_deg": 0, "mirrored": False, "confidence": 0.95}
_CORNERS = [[[102.3, 88.1], [2207.9, 95.4]], [[96.0, 3010.2], [2215.5, 3002.8]]]
_PAGE = {
    "width": 1240,
    "height": 1754,
    "zones": [{"id": "z1", "box": [140, 345, 388, 390], "label": "receiver", "text": "Mr. A. Smith"}],
}
_CLASS = {"name": "letter", "model_version": 7, "cost": 12.4, "probability": 0.97}
_ZONE = {
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
    "text": "Mr. A. Smith",
    "content": {"name": 0.9},
}
_LAYOUT = {
    "id": _RESULT,
    "width": 1240,
    "height": 1754,
    "class": _CLASS,
    "classes": [_CLASS],
    "unknown_probability": 0.03,
    "zones": [_ZONE],
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
_FLAT = {
    "photo": {"width": 2304, "height": 3072},
    "corners": [[96.2, 80.4], [2210.1, 88.9], [2219.8, 3010.5], None],
    "orientation": _ORIENTATION,
    "width": 2307,
    "height": 2968,
    "mesh": {"rows": 2, "columns": 2, "source": _CORNERS},
}
_RECTIFIED = {
    "kind": "planar",
    "evidence": {
        "major_convergence": 0.0019,
        "minor_convergence": 0.0016,
        "text_area_fraction": 0.31,
        "source": ["text"],
        "outline_confidence": None,
        "sides_seen": 0,
    },
    "camera": {
        "focal_length_px": 2503.4,
        "field_of_view_deg": 68.7,
        "source": "estimated",
        "principal_point": [1151.5, 1535.5],
        "principal_point_source": "centre",
    },
    "surface": {"type": "plane", "normal": [0.47, 0.21, 0.86]},
    **_FLAT,
    "warnings": [],
    "timings_ms": _TIMINGS,
    "image": None,
    "image_media_type": None,
}
_MOSAIC = {
    "width": 2480,
    "height": 3508,
    "base": 0,
    "orientation": _ORIENTATION,
    "patches": [
        {
            "placed": True,
            "mesh": {"rows": 2, "columns": 2, "target": _CORNERS},
            "scale": 1.04,
            "sharpness": 1.0,
        },
        {"placed": False, "mesh": None, "scale": None, "sharpness": None},
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
_ACCEPTED = {
    "id": _JOB,
    "state": "queued",
    "stage": None,
    "progress": 0.0,
    "created": _WHEN,
    "started": None,
    "ended": None,
    "problem": None,
    "links": {"result": f"/jobs/{_JOB}/result", "events": f"/jobs/{_JOB}/events"},
    "poll_after_s": 1,
}
_HEALTH = {
    "feedbacks": 60,
    "recent": 50,
    "recent_zone_error": 0.012,
    "recent_class_error": 0.0,
    "recent_text_error": 0.0,
    "earlier_zone_error": 0.034,
    "last_feedback": _WHEN,
}
_FOUND = {"found": "letter", "verified": "letter"}
_DATE = {
    "type": "date",
    "pattern": None,
    "order": "MDY",
    "languages": ["en"],
    "region": None,
    "currency": None,
    "decimal": None,
}
_SETTINGS = {"learner": "passive-aggressive", "genre": None, "continues": None, "fields": {"date": _DATE}}
_VERSIONS = {"name": "letter", "old_version": 7, "new_version": 8}
_MODEL = {
    "format": "layout-graph-model",
    "format_version": 1,
    "name": "letter",
    "nodes": [{"label": None}, {"label": "receiver"}],
}
_RECEIPT = {"id": _SAMPLE, "model": "letter", "zones": 1, "labels": {"receiver": 1}}
_IMPORTED = {"name": "letter", "version": 8, "labels": ["receiver"]}
_UNKNOWN = {"id": _SAMPLE, "result": _RESULT, "created": _WHEN}

BODY_EXAMPLES: Mapping[str, Mapping[str, Any]] = {
    "application/json": {
        "give_layout_feedback": {"class": "letter", "labels": {"z1": "receiver", "z9": None}},
        "import_layout_model": _MODEL,
        "add_layout_sample": _PAGE,
        "train_layout_model": {"rounds": 10},
        "roll_layout_model_back": {"version": 7},
        "change_layout_model_settings": {
            "learner": "counting",
            "fields": {"date": {"type": "date", "order": "MDY"}},
        },
    },
    "multipart/form-data": {
        "rectify": {"image": ["(file photo.jpg)"], "illumination": "normalize", "format": "json"},
        "mosaic": {"images": ["(file a.jpg)", "(file b.jpg)"], "format": "json"},
        "layout": {"image": ["(file page.png)"], "format": "json"},
        "add_layout_samples": {"archive": "(file samples.zip)"},
        "import_layout_models": {"archive": "(file models.zip)"},
    },
}
"""Bodies by media type and operation."""

RESPONSE_EXAMPLES: Mapping[tuple[str, str], Any] = {
    ("200", "rectify"): _RECTIFIED,
    ("200", "mosaic"): _MOSAIC,
    ("200", "layout"): _LAYOUT,
    ("200", "layout_result"): _LAYOUT,
    **{
        ("202", name): _ACCEPTED
        for name in (
            "rectify",
            "mosaic",
            "layout",
            "add_layout_samples",
            "import_layout_models",
            "initialize_layout_model",
            "train_layout_model",
            "propose_layout_classes",
        )
    },
    ("200", "give_layout_feedback"): {
        "id": _SAMPLE,
        "result": _RESULT,
        "created": True,
        "class": _FOUND,
        "zones": 11,
        "wrong": [{"zone": "z1", "found": "body", "verified": "receiver"}],
        "models": [
            {
                **_VERSIONS,
                "cost_found": {"before": 12.4, "after": 14.1},
                "cost_verified": {"before": 13.0, "after": 12.2},
            }
        ],
        "taken_back": [],
        "sample": _SAMPLE,
        "warnings": [],
    },
    ("200", "undo_layout_feedback"): {
        "result": _RESULT,
        "feedback": [_SAMPLE],
        "models": [{"name": "letter", "old_version": 8, "new_version": 9}],
        "samples": 1,
    },
    ("200", "layout_queue"): {
        "results": [
            {
                "id": _RESULT,
                "state": "open",
                "class": "letter",
                "zones": 11,
                "confidence": 0.61,
                "gain": 1.84,
                "decision": "review",
                "has_image": True,
                "created": _WHEN,
                "claimed_by": None,
                "claimed_until": None,
            }
        ]
    },
    ("200", "audit"): {
        "entries": [
            {
                "id": _SAMPLE,
                "time": _WHEN,
                "who": "anna",
                "action": "rollback",
                "model": "letter",
                "detail": "version 8",
            }
        ]
    },
    ("200", "claim_layout_result"): {"result": _RESULT, "claim": "3v1Z8d0LqkU0n0Qb1yWmFA", "until": _WHEN},
    ("200", "layout_model_feedback"): {
        "model": "letter",
        "feedback": [
            {
                "id": _SAMPLE,
                "result": _RESULT,
                "class": _FOUND,
                "zones": 11,
                "wrong": 1,
                "models": [_VERSIONS],
                "sample": _SAMPLE,
                "created": _WHEN,
            }
        ],
    },
    ("200", "layout_models"): {
        "models": [
            {
                "name": "letter",
                "version": 7,
                "samples": 12,
                "labels": ["receiver", "body"],
                "health": _HEALTH,
                "created": _WHEN,
                "updated": _WHEN,
            }
        ]
    },
    ("200", "layout_model"): _MODEL,
    ("200", "import_layout_model"): _IMPORTED,
    ("201", "import_layout_model"): {**_IMPORTED, "version": 1},
    ("200", "initialize_layout_model"): {
        "name": "letter",
        "version": 8,
        "samples": 12,
        "labels": {"receiver": 12},
    },
    ("200", "add_layout_sample"): _RECEIPT,
    ("201", "add_layout_sample"): _RECEIPT,
    ("200", "add_layout_samples"): {
        "model": "letter",
        "added": 1,
        "known": 0,
        "failed": 1,
        "ignored": 0,
        "pages": [
            {"files": ["page/1.xml", "1.png"], "status": "added", "id": _SAMPLE, "problem": None},
            {
                "files": ["page/2.xml"],
                "status": "failed",
                "id": None,
                "problem": {"code": "invalid-option", "detail": "zones: give at least one zone its label."},
            },
        ],
    },
    ("200", "import_layout_models"): {
        "models": [
            {
                "name": "letter",
                "version": 8,
                "changed": True,
                "samples_added": 12,
                "samples_known": 0,
                "problems": [],
            }
        ]
    },
    ("200", "layout_samples"): {
        "model": "letter",
        "samples": [{"id": _SAMPLE, "zones": 1, "labels": {"receiver": 1}, "created": _WHEN}],
    },
    ("200", "layout_sample"): {**_PAGE, "id": _SAMPLE, "model": "letter", "created": _WHEN},
    ("200", "train_layout_model"): {
        "name": "letter",
        "version": 9,
        "changed": True,
        "samples": 12,
        "learner": "passive-aggressive",
        "rounds": [
            {"round": 0, "error": 0.08, "held_out_error": 0.1},
            {"round": 1, "error": 0.03, "held_out_error": 0.06},
        ],
        "kept_round": 1,
        "stopped": "rounds",
    },
    ("200", "layout_model_versions"): {
        "name": "letter",
        "versions": [{"version": 7, "origin": "feedback", "note": "", "created": _WHEN}],
    },
    ("200", "layout_model_diff"): {
        "name": "letter",
        "version": 8,
        "against": 7,
        "total": 1,
        "changes": [
            {"part": "node", "labels": ["receiver"], "attribute": "font_size", "old": 0.41, "new": 0.44}
        ],
    },
    ("200", "roll_layout_model_back"): {
        "name": "letter",
        "version": 9,
        "restored": 7,
        "labels": ["receiver"],
        "samples": 12,
        "later_samples": [],
        "dropped_samples": 0,
    },
    ("200", "layout_model_health"): {"name": "letter", **_HEALTH},
    ("200", "layout_model_settings"): _SETTINGS,
    ("200", "change_layout_model_settings"): {**_SETTINGS, "learner": "counting"},
    ("200", "layout_results"): {
        "results": [
            {
                "id": _RESULT,
                "created": _WHEN,
                "expires": _WHEN,
                "state": "confirmed",
                "class": "letter",
                "probability": 0.97,
                "fields": [
                    {
                        "label": "date",
                        "text": "March 3, 1998",
                        "type": "date",
                        "value": "1998-03-03",
                        "confidence": 0.91,
                        "zones": ["z2"],
                    }
                ],
            }
        ],
        "next": None,
    },
    ("200", "unknown_layout_pages"): {"pages": [{**_UNKNOWN, "zones": 9}]},
    ("200", "unknown_layout_page"): {**_PAGE, **_UNKNOWN},
    ("200", "propose_layout_classes"): {
        "new_classes": [],
        "merges": [
            {
                "models": ["letter", "letters-2024"],
                "fit": 0.96,
                "unsure": 0.44,
                "agreement": 0.93,
                "labels": {"addressee": "receiver"},
                "next": ["DELETE /layout/models/letters-2024."],
            }
        ],
        "splits": [],
        "looked_at": {"unknown_pages": 9, "models": 4, "samples": 71},
    },
    ("200", "job"): {
        **_ACCEPTED,
        "state": "running",
        "stage": "texture_flow",
        "progress": 0.4,
        "started": _WHEN,
    },
    ("200", "job_result"): _RECTIFIED,
    ("201", "create_token"): {"token": "AAAAAGkhb2ibGQv0s5mF3tq1eXcK9w2b", "expires": _WHEN, "ttl_s": 300},
    ("200", "live"): {"status": "alive"},
    ("200", "ready"): {
        "status": "ready",
        "live_workers": 2,
        "disk": "ready",
        "workers": 2,
        "admitted": 0,
        "capacity": 18,
        "ocr": "tesseract",
        "languages": ["deu", "eng"],
        "store": "ready",
    },
}
"""JSON responses by status and operation."""
