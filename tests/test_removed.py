import pytest

from command_line import Verb
from holdfast.removed import LAST_COMMIT, REMOVED

COMMANDS = {
    "verbs": "{}",
    "options": "{}",
    "sources": "detect builtin:any {}:///x",
    "importers": "import . out --format {}",
    "exporters": "export . out --format {}",
    "hands": "hold builtin:any . --hand {}:",
    "labels": "label export {} out .",
    "rules": "info {}.json",
    "features": "info {}.json",
}
"""Command with a part of each kind."""


@pytest.mark.parametrize(
    ("kind", "name"), [(kind, name) for kind in COMMANDS for name in REMOVED[kind]]
)
def test_what_was_removed_is_one_line_with_what_to_use_instead(
    kind, name, capsys, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    key = "type" if kind == "rules" else "kind"
    (tmp_path / f"{name}.json").write_text(f'{{"rule": {{"{key}": "{name}"}}}}')
    message = Verb().refusal(capsys, *COMMANDS[kind].format(name).split())
    assert LAST_COMMIT in message
    assert message.endswith(REMOVED[kind][name])
