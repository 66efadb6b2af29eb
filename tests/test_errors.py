import pickle

import pytest

from holdfast import errors

FAMILIES = (
    errors.RecordingError,
    errors.ModelError,
    errors.TrainingError,
    errors.StreamError,
    errors.SourceError,
    errors.EngineError,
    errors.OutputError,
    errors.MissingExtra,
)


@pytest.mark.parametrize("family", FAMILIES)
def test_every_family_is_caught_as_one(family):
    assert issubclass(family, errors.HoldfastError)
    assert not issubclass(family, ValueError | TypeError | OSError)


def test_the_page_names_every_family():
    classes = {
        value
        for value in vars(errors).values()
        if isinstance(value, type) and value is not errors.HoldfastError
    }
    assert classes == set(FAMILIES)
    assert all(family.__name__ in errors.__doc__ for family in FAMILIES)


def test_a_missing_extra_tells_how_to_get_it():
    failure = errors.MissingExtra("h5py", "hdf5")
    assert str(failure) == (
        'this needs the package h5py, which is not installed: pip install "holdfast[hdf5]"'
    )


def test_a_missing_extra_comes_back_whole_from_another_process():
    failure = errors.MissingExtra("torch", "deep")
    assert str(pickle.loads(pickle.dumps(failure))) == str(failure)
