"""Bodies of requests and responses, one module for each module of routes."""
