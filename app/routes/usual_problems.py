"""Codes of the problems that routes of one kind have in common, for their documentation."""

BODY = ("too-large", "request-timeout")
"""Of whatever has a body."""
FORM = ("bad-request", *BODY)
"""Of a form."""
IMAGE = ("unsupported-media-type", "undecodable-image", "invalid-option")
"""Of whatever takes an image, or zones."""
STORE = ("internal", "store-unavailable")
"""Of whatever is remembered."""
READING = ("not-found", "invalid-option", *STORE)
"""Of whatever is asked of a model."""
WORK = ("out-of-memory", "worker-died", "busy", "shutting-down", "timed-out")
"""Of whatever is done by a worker."""
