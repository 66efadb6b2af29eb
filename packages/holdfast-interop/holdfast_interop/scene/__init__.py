"""What Rerun shows of a recording: frames, arrows, series and events."""
