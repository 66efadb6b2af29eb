import subprocess
import sys

import pytest

from holdfast.io import save_recording
from holdfast.plots.style import page_figure
from holdfast.synthetic import synthetic_recording

DRAWINGS = {
    "a verb": "from holdfast.cli import main; main(['info', 'grasp.parquet', '--plot', 'it.png'])",
    "sensors": "from holdfast.cli import main; main(['sensors', 'gtac', '--plot', 'it.png'])",
    "pyplot": """
from holdfast import Model, detect, load_recording
from holdfast.plots.detection import plot_detection
found = detect(Model.load("builtin:noise-floor"), load_recording("grasp.parquet"))
plot_detection(found)[0].figure.savefig("it.png")
""",
}
SETTINGS = """
axes.facecolor: red
axes.grid: True
savefig.dpi: 30
savefig.facecolor: blue
svg.fonttype: none
xtick.major.size: 20
"""


@pytest.mark.parametrize("drawing", DRAWINGS)
def test_settings_of_the_folder_do_not_change_a_figure(tmp_path, drawing):
    figures = []
    for name, settings in (("plain", ""), ("own", SETTINGS)):
        folder = tmp_path / name
        folder.mkdir()
        (folder / "matplotlibrc").write_text(settings)
        save_recording(synthetic_recording("grasp", 1), folder / "grasp.parquet")
        subprocess.run([sys.executable, "-c", DRAWINGS[drawing]], cwd=folder, check=True)
        figures.append((folder / "it.png").read_bytes())
    assert figures[0] == figures[1]


def test_a_notebook_shows_a_figure_as_a_picture_that_is_always_the_same():
    figure = page_figure(2.0)
    figure.add_subplot().plot([0, 1])
    picture = figure._repr_png_()
    assert picture.startswith(b"\x89PNG") and len(picture) > 2000
    assert picture == figure._repr_png_()
