"""Zones from elsewhere and results for elsewhere: the contract's zones JSON, PAGE-XML and ALTO."""
