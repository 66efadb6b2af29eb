"""`holdfast label`: label recordings on a page or by a rule, compare and audit labels."""

from typing import Annotated

from holdfast.cli.label.inputs import (
    LABEL_ADDRESS,
    AnnotatorOption,
    AuthorOption,
    ModeOptions,
    PathsArgument,
    RuleOptions,
    SaveOptions,
)
from holdfast.cli.options import (
    DEFAULT_JOBS,
    RARE,
    BrowserOption,
    JobsOption,
    JsonOption,
    ServerOptions,
)
from holdfast.errors import require_extras


def label(
    paths: PathsArgument,
    *,
    mode: Annotated[ModeOptions, RARE],
    options: RuleOptions,
    author: AuthorOption = None,
    saving: Annotated[SaveOptions, RARE],
    annotator: Annotated[AnnotatorOption, RARE] = None,
    jobs: Annotated[JobsOption, RARE] = DEFAULT_JOBS,
    access: Annotated[ServerOptions, RARE] = LABEL_ADDRESS,
    browser: BrowserOption = None,
    as_json: JsonOption = False,
) -> None:
    """Label recordings on a page or by a rule, and check labels.

    Without a command, open the labelling page: draw labels with the mouse, set states with keys,
    undo changes, and accept the proposals of a rule. Every change is saved at once. Labels are
    stored in NAME.labels.json beside the recording. The recording itself is never changed. Each
    command has its own help: holdfast label auto --help. See docs/labels.md.

    Example:
      holdfast label recordings/
      holdfast label auto signal recordings/ --dry-run
      holdfast label compare recordings/ labels-of-ann/
      holdfast label audit recordings/ --page
    """
    require_extras("label", *(("train",) if mode.audit else ()))
    access.find_token()  # a wrong token is refused in every mode
    mode.check()
    if mode.auto is not None:
        from holdfast.cli.label.auto import auto

        auto(mode.auto, paths, options=options, author=author, saving=saving, as_json=as_json)
    elif mode.compare:
        from holdfast.cli.label.compare import compare

        if len(paths) != 2:
            raise ValueError(f"--compare A B: two paths expected, {len(paths)} given")
        compare(*paths, options=options, annotator=annotator, as_json=as_json)
    elif mode.export is not None:
        from holdfast.cli.label.export import export

        export(*mode.export, paths, force=saving.force, as_json=as_json)
    elif mode.import_from is not None:
        from holdfast.cli.label.import_ import import_

        import_(
            mode.import_from, paths,
            author=author, saving=saving, annotator=annotator, as_json=as_json,
        )  # fmt: skip
    elif mode.audit:
        from holdfast.cli.label.audit import audit

        audit(
            paths, options=options, page=mode.page, author=author, jobs=jobs,
            access=access, browser=browser, as_json=as_json,
        )  # fmt: skip
    else:
        from holdfast.cli.label.page import show_label_page

        show_label_page(
            paths, options, access, author, browser=browser is not False, as_json=as_json
        )
