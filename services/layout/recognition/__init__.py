"""All models and a page: class, labels, confidences, explanation (5.2, 5.6, 5.7)."""
