"""The page, WebSocket and REST service of a live session."""
