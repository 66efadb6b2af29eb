import pytest

from . import blocks


def write(folder, text):
    path = folder / "page.md"
    path.write_text(text)
    return path


def test_blocks_and_their_notes(folder):
    page = write(
        folder, "a\n\n```sh\nls\n```\n\n<!-- not run: why -->\n```python\n1\n```\n```\nx\n```\n"
    )
    assert [(b.line, b.language, b.text, b.note) for b in blocks.blocks_of(page)] == [
        (3, "sh", "ls\n", ""),
        (7, "python", "1\n", "not run: why"),
        (11, "", "x\n", ""),
    ]


def test_only_some_sections(folder):
    page = write(
        folder, "```python\n1\n```\n## A\n```python\n1\n```\n## B\n```python\n1 / 0\n```\n"
    )
    assert [block.section for block in blocks.blocks_of(page)] == ["", "A", "B"]
    assert blocks.run_page(page, {}, ("", "A")) == 2


def test_python_blocks_share_their_names(folder):
    page = write(folder, "```python\nx = 1\n```\n```python\nassert x == 1\n```\n```json\n{\n```\n")
    assert blocks.run_page(page) == 2


def test_an_error_of_python_has_the_line_of_the_page(folder):
    page = write(folder, "one\n```python\n\nraise KeyError\n```\n")
    with pytest.raises(KeyError) as raised:
        blocks.run_page(page)
    assert raised.traceback[-1].lineno + 1 == 4


def test_a_command(folder):
    (folder / "a.txt").write_text("x\n")
    page = write(folder, "```sh\ncp a.txt \\\n  b.txt  # copy\n```\n")
    assert blocks.run_page(page) == 1
    assert (folder / "b.txt").read_text() == "x\n"


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


def test_an_endless_command_is_interrupted(folder):
    page = "<!-- until Ctrl-C -->\n```sh\n{}\n```\n"
    program = 'import sys, time; print("Ctrl-C stops it", file=sys.stderr); time.sleep(60)'
    with pytest.raises(AssertionError, match="Traceback"):
        blocks.run_page(write(folder, page.format(f"python -c '{program}'")))
    with pytest.raises(AssertionError, match="holdfast: No such"):
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
