"""The laboratory of holdfast: the study, the comparison of grip laws, and their reports."""
