from holdfast.plots.style import PAPER, page_figure, series_styles


def test_eighteen_styles_are_different():
    styles = series_styles(f"method {k}" for k in range(18))
    assert len(set(styles.values())) == 19  # and the paper's
    assert series_styles(["a", PAPER, "b"])["b"] == series_styles(["a", "b"])["b"]


def test_a_notebook_shows_a_figure_as_a_picture_that_is_always_the_same():
    figure = page_figure(2.0)
    figure.add_subplot().plot([0, 1])
    picture = figure._repr_png_()
    assert picture.startswith(b"\x89PNG") and len(picture) > 2000
    assert picture == figure._repr_png_()
