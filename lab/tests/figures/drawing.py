import io


def drawn(figure):
    """Return the figure after it was drawn, which causes most warnings: they are errors here."""
    figure.savefig(io.BytesIO(), format="png", dpi=50)
    return figure
