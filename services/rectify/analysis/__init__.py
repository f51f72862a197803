"""What a photo shows of its page, before a shape is fitted."""
