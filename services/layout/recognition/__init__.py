"""Recognition of a page by all models: class, labels, confidences, explanation (5.2, 5.6, 5.7)."""
