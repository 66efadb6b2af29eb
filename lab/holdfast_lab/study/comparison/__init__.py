"""Parts of the study beyond the paper: all methods, sensitivity, real recordings."""
