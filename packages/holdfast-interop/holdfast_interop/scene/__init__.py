"""What viewers of other programs show of a recording: frames, arrows, series and events."""
