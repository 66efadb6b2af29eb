import pytest

from holdfast.cli import main
from holdfast.io import save_recording
from holdfast.synthetic import synthetic_recording
from holdfast_ros import verb_options


@pytest.fixture
def grasp(tmp_path):
    save_recording(synthetic_recording("grasp", 1), tmp_path / "grasp.mcap")
    return tmp_path / "grasp.mcap"


def test_estimates_that_ros_refuses_are_reported(capsys, monkeypatch, grasp):
    class Refuser:
        n_failed, n_dropped = 7, 2

        def __enter__(self):
            return self

        def __exit__(self, *_):
            pass

        def put(self, said):
            pass

    monkeypatch.setattr(verb_options.Ros2, "publisher", lambda *_: Refuser())
    words = ["serve", "builtin:twin", str(grasp), "--once", "--speed", "50", "--port", "0"]
    assert main([*words, "--ros2"]) == 0
    assert "Refuser: 7 estimates were refused, 2 were dropped" in capsys.readouterr().err
