"""One global developable surface of few parameters, fitted to all that the photo shows of the page's shape."""
