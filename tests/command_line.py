"""A verb of the command line, called in the process of the test."""

import json

from holdfast.cli import main


class Verb:
    """A verb, such as `Verb("train")`; `Verb()` is the whole command line."""

    def __init__(self, *words):
        self._words = words

    def run(self, capsys, *words):
        """Return the exit code, stdout and stderr."""
        code = main([*self._words, *map(str, words)])
        return code, *capsys.readouterr()

    def refusal(self, capsys, *words):
        """Return the message of bad input: one line of stderr, and nothing else."""
        code, out, err = self.run(capsys, *words)
        assert (code, out, err.count("\n")) == (2, "", 1)
        return err.removeprefix("holdfast: ").rstrip("\n")

    def document(self, capsys, *words):
        """Return what it prints with --json."""
        code, out, _ = self.run(capsys, *words, "--json")
        assert code == 0
        return json.loads(out)
