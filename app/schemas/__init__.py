"""Bodies of requests and answers, named as their routes."""
