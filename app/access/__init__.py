"""Who sends a request, and what they may do: keys, roles, tokens, owners, and the list of changes."""
