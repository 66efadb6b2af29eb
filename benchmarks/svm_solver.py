"""The SVM's own solver against liblinear: time, objective and decisions, by C.

Both minimise |v|^2 / 2 + sum_i C_i max(0, 1 - y_i v . x_i) on the same standardised samples of one
finger, with balanced classes. Liblinear stops after 2,000 passes over the samples, as holdfast
used it before.

    uv run python benchmarks/svm_solver.py RECORDINGS     # recordings of the twin, with labels
"""

import argparse
import time
import warnings

import numpy as np
from sklearn.exceptions import ConvergenceWarning
from sklearn.svm import LinearSVC

from holdfast.classifiers.fitting import class_weights, standardise
from holdfast.classifiers.interior_point import fit_svm
from holdfast_lab.study.evaluation.fitted_method import Training
from holdfast_lab.study.evaluation.recording_features import corpus_features
from holdfast_lab.study.methods import METHODS
from holdfast_lab.study.plan import scan_corpus

METHOD_NAMES = ("svm", "jl_local_svm", "jl_global_svm")
CONSTANTS = (0.01, 1.0, 100.0, 1000.0)
MAX_PASSES = 2000


def main():
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("recordings", help="folder of labelled recordings")
    corpus = scan_corpus("main", parser.parse_args().recordings)
    print("| method | features | C | own | liblinear | above the minimum | other decisions |")
    print("|---|--:|--:|--:|--:|--:|--:|")
    for name in METHOD_NAMES:
        training = Training.of(METHODS[name], corpus_features(METHODS[name], corpus))
        samples = next(iter(training.samples.values()))
        _, _, features = standardise(samples.features)
        for c in CONSTANTS:
            print(_line(METHODS[name].title, features, samples.positive, c), flush=True)


def _line(title, features, stable, c):
    weights = class_weights(stable, "balanced")
    began = time.process_time()
    own = fit_svm(features, stable, weights, c)
    own_time, began = time.process_time() - began, time.process_time()
    peer = LinearSVC(
        loss="hinge", dual=True, random_state=0, max_iter=MAX_PASSES, C=c, class_weight="balanced"
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)
        peer.fit(features, stable)
    peer_time = time.process_time() - began

    costs = c * np.where(stable, weights[1], weights[0])
    signs = np.where(stable, 1.0, -1.0)

    def objective(rule, offset):
        margins = signs * (features @ rule + offset)
        return (rule @ rule + offset**2) / 2 + costs @ np.maximum(0.0, 1.0 - margins)

    least = objective(own.weights, own.intercept)
    above = objective(peer.coef_[0], peer.intercept_[0]) / least - 1.0
    other = ((own.decision(features) > 0) != peer.predict(features)).mean()
    return (
        f"| {title} | {features.shape[1]} | {c:g} | {own_time:.2f} s | {peer_time:.2f} s | "
        f"{100 * above:.4f} % | {100 * other:.2f} % |"
    )


if __name__ == "__main__":
    main()
