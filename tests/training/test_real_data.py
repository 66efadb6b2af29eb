"""Figures on the real uSkin recordings against those of an independent computation."""

import pytest

from holdfast.detection import Tare
from holdfast.io.importers import import_recordings
from holdfast.training import Setting, train

REFERENCE = {
    "2022-02-22-08-10-01": {"finger1": (0.909, 0.820), "finger2": (0.880, 0.764)},
    "2022-02-22-11-23-11": {"finger1": (0.386, 0.386), "finger2": (0.436, 0.436)},
}


def test_out_of_fold_figures_agree(data_folder):
    recordings = list(import_recordings(data_folder / "uskin_pick_move", "uskin-pick-move"))
    trained = train(recordings, Setting(trials=0, tare=Tare.parse("first")))
    found = {each.name[-19:]: each.fingers for each in trained.cross_validation.recordings}
    assert len(found) == 5
    for name, fingers in REFERENCE.items():
        for finger, (auc, auc_contact) in fingers.items():
            assert found[name][finger].auc == pytest.approx(auc, abs=0.01)
            assert found[name][finger].auc_contact == pytest.approx(auc_contact, abs=0.01)
    for finger in trained.model.fingers.values():
        assert finger.contact_threshold is None
