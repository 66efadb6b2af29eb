"""How the skin of the twin compares with real ones: features and readouts, by situation."""
