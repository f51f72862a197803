"""Proposals for the set of classes: new classes of unknown pages, classes to merge, classes to split.

Pages without labels are compared zone by zone (`page_distance`) and grouped by average linkage (`groups`): each group
may be a class. Classes are merged or split by what their samples cost by models that were made without them (`merging`,
`splitting`). All of it proposes, nothing changes: the route says which requests would carry it out.
"""
