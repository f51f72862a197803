"""A file a resource, named as its URL: parse, call, map."""
