import pytest

from . import blocks


def write(folder, text):
    path = folder / "page.md"
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("holdfast info none.parquet", "page.md:1: 'holdfast info none.parquet' ended with 2"),
        ("false | cat", "page.md:1: 'false | cat'"),
    ],
)
def test_a_command_that_fails(folder, capsys, line, message):
    with pytest.raises(AssertionError, match=message):
        blocks.run_page(write(folder, f"```sh\n{line}\n```\n"))


def test_options_of_commands_that_do_not_run_must_exist(folder):
    page = "<!-- not run: why -->\n```sh\n{}\n```\n"
    assert blocks.run_page(write(folder, page.format("uv run holdfast demo --speed 0 | cat"))) == 0
    with pytest.raises(Exception, match="No such option: --sped"):
        blocks.run_page(write(folder, page.format("holdfast demo --sped 0")))
    with pytest.raises(Exception, match="No such command 'demonstrate'"):
        blocks.run_page(write(folder, page.format("holdfast demonstrate")))


@pytest.mark.parametrize(
    ("shown", "is_printed"),
    [("b 2.5 s\nc", True), ("a\nb 1.0 s", True), ("a\nc", False), ("b 2.5 min", False)],
)
def test_shown_output_is_what_is_printed(folder, capsys, shown, is_printed):
    """Decimal fractions may differ; no line is left out between two."""
    page = write(folder, f"```python\nprint('a\\nb  1.5 s\\nc')\n```\n```text\n{shown}\n```\n")
    if is_printed:
        assert blocks.run_page(page) == 1
        assert capsys.readouterr().out == "a\nb  1.5 s\nc\n"
    else:
        with pytest.raises(AssertionError, match=r"^page\.md:4: this is not what was pri"):
            blocks.run_page(page)
