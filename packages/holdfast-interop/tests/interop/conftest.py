from cli.conftest import no_progress_messages, terminal_width
from recording_fixtures import assert_same, make_recording, recordings

__all__ = [
    "assert_same", "make_recording", "no_progress_messages", "recordings", "terminal_width"
]  # fmt: skip
