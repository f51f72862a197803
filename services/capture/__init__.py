"""How well a photo of a page can be read: measures, a predicted error, advice for the next photo."""
