"""The verb `holdfast detect`, and what it prints."""
