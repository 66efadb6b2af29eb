import importlib

import pytest

from holdfast.labelling.review import doubtful
from holdfast.labelling.rules.poses import poses_from_bag


@pytest.mark.parametrize(
    ("old", "new", "name"),
    [
        ("doubt", "review.spans", "doubtful"),
        ("poses", "rules.poses", "poses_from_bag"),
        ("changes", "server.signals", "change_points"),
        ("page_schema", "server.schema", "SCHEMA"),
    ],
)
def test_modules_under_their_old_names_still_work(old, new, name):
    module = importlib.import_module(f"holdfast.labelling.{old}")
    with pytest.warns(DeprecationWarning, match=rf"^holdfast\.labelling\.{old} is deprecated; use"):
        found = getattr(module, name)
    assert found is getattr(importlib.import_module(f"holdfast.labelling.{new}"), name)


def test_functions_can_be_imported_from_old_modules():
    with pytest.warns(DeprecationWarning):
        from holdfast.labelling.doubt import doubtful as old_doubtful
    with pytest.warns(DeprecationWarning):
        from holdfast.labelling.poses import poses_from_bag as old_poses_from_bag
    assert (old_doubtful, old_poses_from_bag) == (doubtful, poses_from_bag)


def test_an_attribute_that_does_not_exist():
    module = importlib.import_module("holdfast.labelling.doubt")
    with pytest.warns(DeprecationWarning), pytest.raises(AttributeError, match="nothing"):
        _ = module.nothing
