"""Problem codes and headers that several routes have in common, for their documentation."""

BODY = ("too-large", "request-timeout")
"""Requests with a body."""
FORM = ("bad-request", *BODY)
"""Requests with a form."""
IMAGE = ("unsupported-media-type", "undecodable-image", "invalid-option")
"""Requests with an image or zones."""
STORE = ("internal", "store-unavailable")
"""Requests that use the store."""
READING = ("not-found", "invalid-option", *STORE)
"""Requests that read a model."""
WORK = ("out-of-memory", "worker-died", "busy", "shutting-down", "timed-out")
"""Requests that a worker processes."""
FILE_NAME = {
    "Content-Disposition": {
        "description": "Of files: a name, after that of the (first) upload if it has one.",
        "schema": {"type": "string"},
    }
}
"""The header of files."""
