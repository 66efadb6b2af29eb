from recording_fixtures import assert_same, flipped, make_recording, recordings

__all__ = ["assert_same", "flipped", "make_recording", "recordings"]
