"""One method on one corpus: fitted, judged, and counted."""
