import msgspec
import pytest

from holdfast.detection import Model
from holdfast.errors import ModelError
from holdfast_lab.trial.plan import TrialPlan, run_numbered


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"laws": ("magic",)}, "'magic'"),
        ({"laws": ("fixed", "fixed")}, "'fixed' is given twice"),
        ({"n": 0}, "0 given"),
        ({"seed": -1}, "-1 given"),
        ({"plant": "soft"}, "'soft'"),
    ],
)
def test_a_plan_refuses_what_cannot_be_run(given, message):
    with pytest.raises(ValueError, match=message):
        TrialPlan(**given)


def test_a_model_with_a_tare_of_a_recording_is_refused(tmp_path):
    model = msgspec.structs.replace(Model.load("builtin:noise-floor"), tare="0:1")
    model.save(tmp_path / "interval.json")
    with pytest.raises(ModelError, match="where samples come one by one"):
        TrialPlan(model=str(tmp_path / "interval.json"))


def test_a_worker_with_another_model_is_refused():
    with pytest.raises(ModelError, match="builtin:any"):
        run_numbered(0, 0, "fixed", "builtin:any", "another")
