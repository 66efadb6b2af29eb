import pytest

from . import blocks


def write(folder, text):
    path = folder / "page.md"
    path.write_text(text)
    return path


def test_a_command_that_fails(folder):
    with pytest.raises(AssertionError, match=r"page\.md:1: 'holdfast info none\.parquet'"):
        blocks.run_page(write(folder, "```sh\nholdfast info none.parquet\n```\n"))


def test_options_of_commands_that_do_not_run_must_exist(folder):
    with pytest.raises(Exception, match="--sped"):
        blocks.run_page(
            write(folder, "<!-- not run: why -->\n```sh\nholdfast demo --sped 0\n```\n")
        )


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
