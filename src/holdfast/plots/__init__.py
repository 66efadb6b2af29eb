"""Figures, drawn without a screen."""

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00")
"""Colours of series, distinct for colour-blind readers too (Okabe and Ito).

Pages draw with them too, without Matplotlib."""
