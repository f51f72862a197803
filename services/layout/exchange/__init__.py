"""Reading and writing of zones and results: zones JSON of the HTTP contract, PAGE-XML and ALTO."""
