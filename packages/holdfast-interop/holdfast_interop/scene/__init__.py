"""Content of a recording in Rerun: frames, arrows, series and events."""
