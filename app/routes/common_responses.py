"""Codes of problems that routes have in common, for their documentation."""

BODY = ("too-large", "request-timeout")
"""Of requests with a body."""
FORM = ("bad-request", *BODY)
"""Of requests with a form."""
IMAGE = ("unsupported-media-type", "undecodable-image", "invalid-option")
"""Of requests with an image or zones."""
STORE = ("internal", "store-unavailable")
"""Of requests that use the store."""
READING = ("not-found", "invalid-option", *STORE)
"""Of requests about a model."""
WORK = ("out-of-memory", "worker-died", "busy", "shutting-down", "timed-out")
"""Of requests that a worker does."""
