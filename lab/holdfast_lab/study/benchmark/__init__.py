"""The frozen benchmark: its data, submissions of other programs, and their scores."""
