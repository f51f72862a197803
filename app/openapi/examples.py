"""Examples of the OpenAPI document: a short real request and response for every operation."""

from collections.abc import Mapping
from typing import Any

from app.http.octets import OCTETS
from app.openapi.example_documents import (
    ACCEPTED,
    FOUND,
    HEALTH,
    IMPORTED,
    LAYOUT,
    MODEL,
    MOSAIC,
    PAGE,
    RECEIPT,
    RECTIFIED,
    RESULT,
    SAMPLE,
    SETTINGS,
    UNKNOWN,
    UPLOAD,
    VERSIONS,
    WHEN,
)
from app.openapi.plain_answers import PLAIN_MOSAIC, PLAIN_PAGES
from services.contract.answers.rectify import PagesResult, RectifyResult

_PHOTO = ["(file photo.jpg)"]
_PHOTOS = ["(file a.jpg)", "(file b.jpg)"]
_PAGES = PagesResult(pages=[RectifyResult.model_validate(RECTIFIED)], warnings=[], timings_ms={})

BODY_EXAMPLES: Mapping[str, Mapping[str, Any]] = {
    "application/json": {
        "render_kept_page": {"rotate": 90, "illumination": "bw", "format": "pdf"},
        "bind_kept_pages": {"pages": [RESULT], "format": "pdf"},
        "give_layout_feedback": {"class": "letter", "labels": {"z1": "receiver", "z9": None}},
        "import_layout_model": MODEL,
        "add_layout_sample": PAGE,
        "train_layout_model": {"rounds": 10},
        "roll_layout_model_back": {"version": 7},
        **{
            f"{name}_layout_result": {"claim": "3v1Z8d0LqkU0n0Qb1yWmFA"}
            for name in ("claim", "release", "skip")
        },
        "change_layout_model_settings": {
            "learner": "counting",
            "fields": {"date": {"type": "date", "order": "MDY"}},
            "elements": {"subject": "h1"},
        },
    },
    OCTETS: {"send_piece": "(the next bytes of the file)"},
    "multipart/form-data": {
        "rectify": {"image": _PHOTO, "illumination": "normalize", "format": "json"},
        "mosaic": {"images": _PHOTOS, "format": "json"},
        "rectify_to_image": {"image": _PHOTO, "illumination": "normalize"},
        "rectify_to_pdf": {"image": _PHOTO, "text": True},
        "rectify_to_text": {"image": _PHOTO, "format": "markdown"},
        "rectify_to_pages": {"image": _PHOTO, "text": True},
        "mosaic_to_image": {"images": _PHOTOS, "format": "png"},
        "mosaic_to_pdf": {"images": _PHOTOS, "text": True},
        "mosaic_to_json": {"images": _PHOTOS},
        "layout": {"image": ["(file page.png)"], "format": "json"},
        "add_layout_samples": {"archive": "(file samples.zip)"},
        "import_layout_models": {"archive": "(file models.zip)"},
    },
}
"""Bodies by media type and operation."""

RESPONSE_EXAMPLES: Mapping[tuple[str, str], Any] = {
    ("200", "rectify"): RECTIFIED,
    ("200", "kept_page"): RECTIFIED,
    ("200", "render_kept_page"): RECTIFIED,
    ("200", "mosaic"): MOSAIC,
    ("200", "rectify_to_pages"): PLAIN_PAGES.convert(_PAGES.model_dump(mode="json")),
    ("200", "mosaic_to_json"): PLAIN_MOSAIC.convert(MOSAIC),
    ("200", "layout"): LAYOUT,
    ("200", "layout_result"): LAYOUT,
    **{
        ("202", name): ACCEPTED
        for name in (
            "rectify",
            "mosaic",
            *(f"rectify_to_{what}" for what in ("image", "pdf", "text", "pages")),
            *(f"mosaic_to_{what}" for what in ("image", "pdf", "json")),
            "layout",
            "add_layout_samples",
            "import_layout_models",
            "initialize_layout_model",
            "train_layout_model",
            "propose_layout_classes",
        )
    },
    ("200", "give_layout_feedback"): {
        "id": SAMPLE,
        "result": RESULT,
        "created": True,
        "class": FOUND,
        "zones": 11,
        "wrong": [{"zone": "z1", "found": "body", "verified": "receiver"}],
        "models": [
            {
                **VERSIONS,
                "cost_found": {"before": 12.4, "after": 14.1},
                "cost_verified": {"before": 13.0, "after": 12.2},
            }
        ],
        "taken_back": [],
        "sample": SAMPLE,
        "warnings": [],
    },
    ("200", "undo_layout_feedback"): {
        "result": RESULT,
        "feedback": [SAMPLE],
        "models": [{"name": "letter", "old_version": 8, "new_version": 9}],
        "samples": 1,
    },
    ("200", "list_cameras"): {
        "cameras": [
            {
                "name": "tablet-3",
                "field_of_view_deg": 68.2,
                "deviation": 0.011,
                "photos": 12,
                "decides": True,
                "used_at": WHEN,
            }
        ]
    },
    ("201", "begin_upload"): {**UPLOAD, "offset": 0},
    ("200", "show_upload"): UPLOAD,
    ("200", "audit"): {
        "entries": [
            {
                "id": SAMPLE,
                "time": WHEN,
                "who": "anna",
                "action": "rollback",
                "model": "letter",
                "detail": "version 8",
            }
        ]
    },
    ("200", "claim_layout_result"): {
        "result": RESULT,
        "claim": "3v1Z8d0LqkU0n0Qb1yWmFA",
        "until": WHEN,
        "recognized_again": False,
    },
    ("200", "layout_model_feedback"): {
        "model": "letter",
        "feedback": [
            {
                "id": SAMPLE,
                "result": RESULT,
                "class": FOUND,
                "zones": 11,
                "wrong": 1,
                "models": [{**VERSIONS, "without_effect": None}],
                "sample": SAMPLE,
                "created": WHEN,
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
                "health": HEALTH,
                "created": WHEN,
                "updated": WHEN,
            }
        ]
    },
    ("200", "layout_model"): MODEL,
    ("200", "import_layout_model"): IMPORTED,
    ("201", "import_layout_model"): {**IMPORTED, "version": 1},
    ("200", "initialize_layout_model"): {
        "name": "letter",
        "version": 8,
        "samples": 12,
        "labels": {"receiver": 12},
    },
    ("200", "add_layout_sample"): RECEIPT,
    ("201", "add_layout_sample"): RECEIPT,
    ("200", "add_layout_samples"): {
        "model": "letter",
        "added": 1,
        "known": 0,
        "failed": 1,
        "ignored": 0,
        "pages": [
            {"files": ["page/1.xml", "1.png"], "status": "added", "id": SAMPLE, "problem": None},
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
                "more_problems": 0,
            }
        ]
    },
    ("200", "layout_samples"): {
        "model": "letter",
        "samples": [{"id": SAMPLE, "zones": 1, "labels": {"receiver": 1}, "created": WHEN}],
    },
    ("200", "layout_sample"): {**PAGE, "id": SAMPLE, "model": "letter", "created": WHEN},
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
        "versions": [{"version": 7, "origin": "feedback", "note": "", "created": WHEN}],
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
    ("200", "layout_model_health"): {"name": "letter", **HEALTH},
    ("200", "layout_model_settings"): SETTINGS,
    ("200", "change_layout_model_settings"): {**SETTINGS, "learner": "counting"},
    ("200", "layout_results"): {
        "results": [
            {
                "id": RESULT,
                "file_name": "scan-0412.jpg",
                "created": WHEN,
                "expires": WHEN,
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
                "review": {
                    "zones": 11,
                    "confidence": 0.61,
                    "gain": 1.84,
                    "decision": "review",
                    "has_image": True,
                    "claimed_by": None,
                    "claimed_until": None,
                },
            }
        ],
        "next": None,
    },
    ("200", "unknown_layout_pages"): {"pages": [{**UNKNOWN, "zones": 9}]},
    ("200", "unknown_layout_page"): {**PAGE, **UNKNOWN},
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
        **ACCEPTED,
        "state": "running",
        "stage": "texture_flow",
        "progress": 0.4,
        "attempts": 1,
        "started": WHEN,
    },
    ("200", "job_result"): RECTIFIED,
    ("201", "create_token"): {"token": "AAAAAGkhb2ibGQv0s5mF3tq1eXcK9w2b", "expires": WHEN, "ttl_s": 300},
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
        "blobs": "ready",
        "queue": "ready",
        "job_runners": 1,
    },
}
"""JSON responses by status and operation."""
