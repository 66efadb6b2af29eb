"""Compare the TCN of Grover et al. with other methods, by recording and by object.

    holdfast study --twin --out study/
    pip install 'holdfast[deep]'
    python benchmarks/tcn.py study/data/main --jobs 2

The network takes hours at the size of the study, so all methods get fewer windows and folds here,
the same for each. The network is trained until the loss of held-out training recordings has not
fallen for 15 epochs.
"""

import argparse
import time
from pathlib import Path

from joblib import Parallel, delayed

from holdfast_lab.study.evaluation.evaluate_method import (
    EvaluationEffort,
    EvaluationJob,
    MethodEvaluation,
    evaluate_method,
)
from holdfast_lab.study.methods import METHODS
from holdfast_lab.study.plan import Corpus, scan_corpus

COMPARED = ("logreg", "svm_unweighted", "log_two", "anyskin", "holdfast", "tcn")
TITLES = {"recording": "by recording", "object": "by object"}


def main(folder: Path, jobs: int, effort: EvaluationEffort) -> None:
    corpus = scan_corpus("main", folder)
    start = time.perf_counter()
    runs = Parallel(n_jobs=jobs, return_as="generator")(
        delayed(evaluate)(corpus, method, split, effort)
        for method in reversed(COMPARED)
        for split in TITLES
    )
    print(f"{len(corpus.recordings)} recordings, {effort}")
    print("| split | method | accuracy % | FDR % | FNR % | AUC contact | seconds |")
    print("|---|---|---|---|---|---|---|")
    for method, split, found, seconds in runs:
        pooled = found.metrics.pooled
        print(
            f"| {TITLES[split]} | {METHODS[method].title} | {pooled.accuracy:.1f} | "
            f"{pooled.fdr:.1f} | {pooled.fnr:.1f} | {pooled.auc_contact:.3f} | {seconds:.0f} |",
            flush=True,
        )
    print(f"{time.perf_counter() - start:.0f} s")


def evaluate(
    corpus: Corpus, method: str, split: str, effort: EvaluationEffort
) -> tuple[str, str, MethodEvaluation, float]:
    start = time.perf_counter()
    job = EvaluationJob(method, corpus, (split,), effort=effort, compared=COMPARED)
    found = evaluate_method(job)[split]
    return method, split, found, time.perf_counter() - start


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--windows", type=int, default=2000, help="of a finger, to train")
    given = parser.parse_args()
    size = EvaluationEffort(folds=2, inner=2, stride=5, max_samples=given.windows)
    main(given.folder, given.jobs, size)
