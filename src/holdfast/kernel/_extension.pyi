SOURCES: str
"""The digest of the C files that this extension was built from."""
