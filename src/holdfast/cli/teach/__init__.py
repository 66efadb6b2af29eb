"""`holdfast teach`, in several files."""
