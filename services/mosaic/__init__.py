"""Several overlapping photos of one page -> the whole page (dissertation chapter 4)."""
