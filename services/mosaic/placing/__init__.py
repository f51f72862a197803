"""All photos in their places on one page, in the frame that they agree on."""
