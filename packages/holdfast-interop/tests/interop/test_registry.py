import re
from pathlib import Path

import pytest

from holdfast.io.importers import FORMATS, IMPORTER_PLUGINS
from holdfast.sensors import built_in_sensors
from holdfast_interop.datasets import find_set, public_sets


@pytest.mark.parametrize("public", public_sets().values(), ids=lambda public: public.name)
def test_a_set_names_what_holdfast_has(public):
    assert set(public.sensors) <= set(built_in_sensors())
    assert public.importer in (*FORMATS, *IMPORTER_PLUGINS.names())
    assert public.address.startswith("https://")
    assert public.address.endswith("/")
    assert len({file.path for file in public.files}) == len(public.files)
    for file in public.files:
        assert re.fullmatch(r"(?!.*\.\.)\w[\w./-]*", file.path)
        assert file.sha256 is None or re.fullmatch("[0-9a-f]{64}", file.sha256)


def test_an_unknown_name():
    with pytest.raises(ValueError, match="'slip'; there are uskin-pick-move"):
        find_set("slip")


def test_the_page_of_data_sets_has_all_sets():
    page = Path(__file__).parents[4].joinpath("docs/datasets.md").read_text("utf-8")
    for name, public in public_sets().items():
        assert f"| `{name}` |" in page
        assert f"| {public.licence} |" in page
    files = [file for public in public_sets().values() for file in public.files]
    known = sum(file.sha256 is not None for file in files)
    assert f"Checksums** of {known} files" in page
    assert f"The other {len(files) - known} files" in page
