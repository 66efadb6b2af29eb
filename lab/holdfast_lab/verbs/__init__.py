"""The verbs `study` and `trial`, which the command line finds by entry points."""
