"""The detector at work: fed from a source, recorded, shown on a page, published."""
