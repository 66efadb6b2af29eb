"""The labelling page's server: workspace of recordings, label store, signals, JSON API."""
