"""What pages and samples say of the set of classes: pages of a class that has no model, classes that are one or two."""
