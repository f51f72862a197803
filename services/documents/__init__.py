"""Documents of one or more pages: PDFs whose text can be searched, archival PDFs."""
