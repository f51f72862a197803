"""Text lines traced in a flat view of the page, as observations in the photo."""
