"""The paper's own tables and figures, by its own protocol."""
