"""Proposals for the set of classes: new classes of unknown pages, classes to merge, classes to split."""
