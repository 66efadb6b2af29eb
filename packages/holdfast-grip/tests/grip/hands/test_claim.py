"""The claim on a hand: one process of a user controls it, whatever its environment."""

import os
import pwd
import subprocess
import sys
from pathlib import Path

import pytest

from holdfast.cli import main
from holdfast_grip.errors import HandError
from holdfast_grip.hands import Claim, claim, open_hand

CLAIM = """
import sys
from holdfast_grip.hands import Claim, open_hand
from holdfast_grip.errors import HandError
try:
    with Claim(open_hand(sys.argv[1]).resource):
        print("claimed")
except HandError as refusal:
    print(refusal)
"""
OTHER_CONTROLLER = "has another controller already: stop that one first"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder of claims that only the test has."""
    path = tmp_path / "home" / "claims"
    monkeypatch.setattr(claim, "claims_folder", lambda: path)
    return path


def file_of_claim(folder):
    """The path of the file of a claim on `hand`, which is free now."""
    with Claim("hand"):
        (path,) = folder.iterdir()
    return path


def claimed_elsewhere(uri, cwd, **environment):
    """What another process prints that claims a hand."""
    done = subprocess.run(
        [sys.executable, "-c", CLAIM, uri], cwd=cwd, env=os.environ | environment,
        stdout=subprocess.PIPE, text=True, check=True,
    )  # fmt: skip
    return done.stdout.strip()


@pytest.mark.parametrize("variable", ["TMPDIR", "HOME", "XDG_RUNTIME_DIR", "XDG_STATE_HOME"])
def test_a_shell_with_another_environment_is_refused(tmp_path, variable):
    (tmp_path / "other").mkdir(mode=0o700)
    other = {variable: str(tmp_path / "other")}
    with Claim(open_hand(f"log:{tmp_path}/hand").resource):
        assert OTHER_CONTROLLER in claimed_elsewhere("log:./hand", tmp_path, **other)
    assert claimed_elsewhere("log:hand", tmp_path, **other) == "claimed"
    assert list((tmp_path / "other").iterdir()) == []


def test_the_claim_of_a_process_that_died_ends_with_it(folder):
    file_of_claim(folder).touch()
    with Claim("hand"), pytest.raises(HandError, match=OTHER_CONTROLLER), Claim("hand"):
        pass
    assert list(folder.iterdir()) == []


def test_two_hands_have_two_controllers(folder):
    with Claim("a"), Claim("b"):
        assert len(list(folder.iterdir())) == 2
        assert {path.stat().st_mode & 0o777 for path in folder.iterdir()} == {0o600}
    assert folder.stat().st_mode & 0o777 == 0o700


@pytest.mark.parametrize("link", ["file", "folder"])
def test_a_symbolic_link_is_not_followed(folder, tmp_path, link):
    target = tmp_path / "target"
    if link == "file":
        file_of_claim(folder).symlink_to(target / "claim")
    else:
        folder.parent.mkdir()
        folder.symlink_to(target)
    target.mkdir(mode=0o700)
    with pytest.raises(HandError, match=r"^cannot claim hand in .*/claims: "):
        Claim("hand").__enter__()
    assert list(target.iterdir()) == []


def test_a_folder_that_others_can_use_is_refused_in_one_line(folder, tmp_path, capsys):
    folder.mkdir(parents=True)
    folder.chmod(0o770)
    hand = f"log:{tmp_path}/hand"
    words = ["hold", "builtin:twin", "twin:?object=can", "--hand", hand, "--armed"]
    assert main([*words, "--confirm", hand]) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    assert str(folder) in err and "mode 700" in err
    assert not (tmp_path / "hand").exists()


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can give a folder away")
def test_a_folder_of_another_user_is_refused(folder):
    folder.mkdir(mode=0o700, parents=True)
    os.chown(folder, 65534, 65534)
    with pytest.raises(HandError, match="one of user 65534 with mode 700 found"):
        Claim("hand").__enter__()


def test_the_folder_depends_on_the_user_only(monkeypatch, tmp_path):
    account = pwd.getpwuid(os.geteuid())

    def with_home(path):
        monkeypatch.setattr(pwd, "getpwuid", lambda _: pwd.struct_passwd((*account[:5], path, "")))
        return claim.claims_folder()

    without_home = Path(f"/tmp/holdfast-claims-{os.geteuid()}")
    assert with_home(str(tmp_path)) == tmp_path / ".local/state/holdfast/claims"
    assert with_home("/nonexistent") == without_home
    monkeypatch.setattr(pwd, "getpwuid", {}.__getitem__)
    assert claim.claims_folder() == without_home


class TestResource:
    def test_a_file_by_any_path(self, tmp_path, monkeypatch):
        monkeypatch.chdir(tmp_path)
        (tmp_path / "link").symlink_to("hand")
        expected = f"log:{os.path.realpath(tmp_path / 'hand')}"
        for uri in ("log:hand", "log:./hand", f"log:{tmp_path}/hand", "log:x/../hand", "log:link"):
            assert open_hand(uri).resource == expected
        assert open_hand("log:other").resource != expected
