import pytest


@pytest.fixture(scope="session")
def real_packets(data_folder):
    """Packets of XELA's own, by model: they stand beside the real recordings."""
    folder = data_folder.parent / "facts" / "xela_samples"
    found = {path.name.split(".")[0]: path.read_text() for path in sorted(folder.glob("*.json"))}
    if not found:
        pytest.skip("no packets of a real XELA server here")
    return found
