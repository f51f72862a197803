"""The request of jobs whose work is not the point."""

from models.job_records import RequestJson

RECTIFY: RequestJson = {
    "method": "POST",
    "path": "/rectify",
    "query": "",
    "headers": {},
    "request_id": "the request",
    "caller": None,
}
