"""Model of a uSkin fingertip: from forces on its skin to counts."""
