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
def test_every_class_is_a_holdfast_error(family):
    assert issubclass(family, errors.HoldfastError)
    assert not issubclass(family, ValueError | TypeError | OSError)


def test_the_docstring_names_every_class():
    classes = {
        value
        for value in vars(errors).values()
        if isinstance(value, type) and value is not errors.HoldfastError
    }
    assert classes == set(FAMILIES)
    assert all(family.__name__ in errors.__doc__ for family in FAMILIES)


def test_a_missing_extra_names_the_command_to_install_it():
    failure = errors.MissingExtra("h5py", "hdf5")
    assert str(failure) == (
        'this needs the package h5py, which is not installed: pip install "holdfast[hdf5]"'
    )


def test_a_missing_extra_can_be_pickled():
    failure = errors.MissingExtra("torch", "deep")
    assert str(pickle.loads(pickle.dumps(failure))) == str(failure)
