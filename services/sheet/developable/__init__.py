"""A global developable surface of few parameters, fitted to all evidence of the page's shape in the photo."""
