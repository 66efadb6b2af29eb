"""Parts that the web pages of holdfast share: access control, server, scripts and styles."""
