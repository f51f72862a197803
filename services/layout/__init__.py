"""Layout structure recognition (dissertation chapter 5): zones -> document class and logical labels."""
