"""Routes, one file for each resource: parse the request, call, build the response."""
