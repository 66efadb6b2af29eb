import pytest

from holdfast.kernel.sources import digest


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "kernel").mkdir()
    (tmp_path / "kernel" / "force.c").write_bytes(b"int taxels = 30;\n")
    (tmp_path / "kernel" / "force.h").write_bytes(b"")
    return tmp_path / "kernel"


def test_the_digest_changes_with_names_and_content_of_c_files_only(folder):
    first = digest(folder.parent)
    assert len(first) == 16
    (folder / "force.py").write_text("n = 1")
    (folder / "force.c").write_bytes(b"int taxels = 30;\r\n")  # as git can check it out on Windows
    assert digest(folder.parent) == first
    (folder / "force.c").write_bytes(b"int taxels = 31;\n")
    second = digest(folder.parent)
    (folder / "force.h").rename(folder / "haar.h")
    assert len({first, second, digest(folder.parent)}) == 3
