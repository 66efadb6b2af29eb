"""Live detection: detect, record and publish the samples of a source."""
