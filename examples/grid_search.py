"""Search window and regularisation with scikit-learn: grid_search.py [RECORDINGS].

`groups` keeps all recordings of an object in one fold, so that each is tested on unseen objects.
"""

import sys

from sklearn.model_selection import GridSearchCV, GroupKFold

from holdfast import StabilityClassifier, load_dataset
from holdfast.synthetic import synthetic_recording


def main(folder: str = "") -> None:
    """Search on a folder of labelled recordings, or on synthetic ones."""
    synthetic = [synthetic_recording(f"grasp-{seed}", seed, ("thumb",)) for seed in range(6)]
    recordings = list(load_dataset(folder)) if folder else synthetic
    objects = [str(recording.metadata.get("object", recording.name)) for recording in recordings]
    search = GridSearchCV(
        StabilityClassifier(),
        {"window": [8, 14], "C": [0.1, 1.0]},
        cv=GroupKFold(min(3, len(set(objects)))),
    )
    search.fit(recordings, groups=objects)
    for setting, score in zip(
        search.cv_results_["params"], search.cv_results_["mean_test_score"], strict=True
    ):
        print(f"{setting}: {100 * score:.1f} % of the samples of unseen objects are right")
    print("best:", search.best_params_)


if __name__ == "__main__":
    main(*sys.argv[1:])
