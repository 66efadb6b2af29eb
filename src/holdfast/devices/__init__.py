"""Whatever opens a connection: sources of samples, and hands that take commands."""
