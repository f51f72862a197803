"""Tables of items: what samples teach of their columns, and the rows and cells of a page."""
