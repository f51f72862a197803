"""The layout graph model of a class: its values, its document, its costs, and its estimation from pages (5.3, 5.5)."""
