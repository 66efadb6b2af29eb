"""Labels in other formats: Label Studio, CSV, recordings, label files."""
