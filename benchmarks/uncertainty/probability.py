"""Fit and cross-validation of the probability that a pose is correct.

    python -m benchmarks.uncertainty.failure_trials trials.npz
    python -m benchmarks.uncertainty.probability trials.npz [more.npz ...] [--fit]
        [--figure reliability.png]

Prints failure detection by the model in scanlock, and by the same model fitted without the scene
that it is evaluated on (all real scans of one folder, or every fifth simulated scene). ``--fit``
prints the constants of `scanlock/registration/verification/probability.py`.
"""

import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.stats import rankdata

from benchmarks._common.arguments import make_parser
from benchmarks._common.results import Results
from scanlock.registration.registry import METHODS
from scanlock.registration.verification import probability as model
from scanlock.registration.verification.decision import MIN_PROBABILITY

_FOLDS = 5
"""Number of folds of the simulated scenes, by seed."""

_SIGNS = (-1, -1, -1, -1, 1, -1, 1)
"""Required signs of the weights."""

_SHRINKAGE = 1e-3
"""Weight of the squared standardised weights in the loss."""

_BINS = (0.0, 0.001, 0.01, 0.05, 0.2, 0.5, 0.8, 0.95, 0.99, 0.999, 1.0)
"""Edges of the probability bins."""

Numbers = NDArray[np.float64]


def read(paths: list[Path]) -> dict[str, Any]:
    """Return the concatenated columns of several files of trials."""
    files = [np.load(path) for path in paths]
    return {name: np.concatenate([one[name] for one in files]) for name in files[0].files}


def folds_of(scenes: NDArray[np.str_]) -> NDArray[np.str_]:
    """Return the fold of each scene."""
    found: list[str] = []
    for scene in scenes:
        seed = re.fullmatch(r"simulated \w+ (\d+)", scene)
        found.append(str(scene) if seed is None else f"simulated {int(seed[1]) % _FOLDS}")
    return np.array(found)


def fitted(features: Numbers, right: NDArray[np.bool_]) -> Numbers:
    """Return intercept and weights of the regularised logistic regression."""
    mean, deviation = features.mean(axis=0), features.std(axis=0)
    rows = np.column_stack([np.ones(len(features)), (features - mean) / deviation])
    signs = np.where(right, 1.0, -1.0)
    penalty = np.array([0.0] + [_SHRINKAGE] * features.shape[1])

    def loss(weights: Numbers) -> tuple[float, Numbers]:
        margins = signs * (rows @ weights)
        slopes = -signs / (1.0 + np.exp(margins))
        value = np.logaddexp(0.0, -margins).mean() + penalty @ weights**2
        return float(value), rows.T @ slopes / len(rows) + 2.0 * penalty * weights

    bounds = [(None, None)]
    bounds += [(0.0 if sign > 0 else None, 0.0 if sign < 0 else None) for sign in _SIGNS]
    start = np.zeros(rows.shape[1])
    standard = minimize(loss, start, jac=True, method="L-BFGS-B", bounds=bounds).x
    weights = standard[1:] / deviation
    return np.concatenate([[standard[0] - weights @ mean], weights])


def area_under_curve(scores: Numbers, right: NDArray[np.bool_]) -> float:
    """Return the area under the ROC curve."""
    ranks = rankdata(scores)
    positive = int(right.sum())
    above = ranks[right].sum() - positive * (positive + 1) / 2
    return float(above / (positive * (len(right) - positive)))


def row(name: str, scores: Numbers, right: NDArray[np.bool_], ok: NDArray[np.bool_]) -> list[str]:
    """Return the cells of `COLUMNS`."""
    wrong = ~right
    return [
        name,
        f"{right.sum()} correct, {wrong.sum()} wrong",
        f"{area_under_curve(scores, right):.4f}" if right.any() and wrong.any() else "-",
        f"{(ok & wrong).sum()} ({1e3 * (ok & wrong).sum() / max(1, wrong.sum()):.1f} in 1000)",
        f"{(right & ~ok).sum()} ({100 * (right & ~ok).mean() / max(1e-9, right.mean()):.1f} %)",
    ]


COLUMNS = ("trials", "poses", "area under the ROC curve", "wrong, called ok", "correct, refused")


def main() -> None:
    parser = make_parser(__doc__)
    parser.add_argument("trials", type=Path, nargs="+")
    parser.add_argument("--fit", action="store_true", help="print the constants of the model")
    parser.add_argument("--figure", type=Path, help="write a reliability diagram")
    parser.add_argument("--each", action="store_true", help="print every wrong pose with status ok")
    arguments = parser.parse_args()
    results = Results(arguments.json)
    trials = read(arguments.trials)
    is_own = np.isin(trials["method"], list(METHODS))
    own = {name: column[is_own] for name, column in trials.items()}
    right, features = own["right"], own["features"]
    folds = folds_of(own["scene"])
    left_out = np.empty(len(right))
    for fold in np.unique(folds):
        weights = fitted(features[folds != fold], right[folds != fold])
        left_out[folds == fold] = weights[0] + features[folds == fold] @ weights[1:]
    held_out = 1.0 / (1.0 + np.exp(-left_out))
    current = 1.0 / (1.0 + np.exp(-(model.INTERCEPT + features @ np.array(model.WEIGHTS))))
    if arguments.fit:
        weights = fitted(features, right)
        print(f"INTERCEPT = {weights[0]:.2f}")
        print(f"WEIGHTS = ({', '.join(f'{weight:.2f}' for weight in weights[1:])})")
    # Independent of the probability.
    refused = own["vetoed"]
    print(f"{len(right)} trials; {results.machine_line}\n")
    held_ok = (held_out >= MIN_PROBABILITY) & ~refused
    ok = (current >= MIN_PROBABILITY) & ~refused
    rows = [
        row("all, scene left out of the fit", held_out, right, held_ok),
        row("all, as in scanlock", current, right, ok),
    ]
    for name in ("kind", "method"):
        for value in np.unique(own[name]):
            at = own[name] == value
            rows.append(row(f"{value}, scene left out", held_out[at], right[at], held_ok[at]))
    for fold in np.unique(folds):
        at = folds == fold
        rows.append(row(f"{fold}, left out", held_out[at], right[at], held_ok[at]))
    for name in np.unique(trials["method"][~is_own]):
        at = trials["method"] == name
        claimed = trials["status"][at] == "ok"
        rows.append(row(name, trials["score"][at], trials["right"][at], claimed))
    results.add_table(COLUMNS, rows, title="failure detection")
    columns = ("probability", "trials", "mean probability", "correct")
    results.add_table(columns, reliability(held_out, right), title="reliability")
    if arguments.each:
        for index in np.flatnonzero(held_ok & ~right):
            print([str(own[name][index]) for name in ("scene", "kind", "method")], end=" ")
            print(f"{own['metres'][index]:.2f} m {own['degrees'][index]:.2f} deg", end=" ")
            print(f"{held_out[index]:.3f}", np.round(features[index], 2).tolist())
    if arguments.figure is not None:
        draw(arguments.figure, held_out, right)


def reliability(predicted: Numbers, right: NDArray[np.bool_]) -> list[list[str]]:
    """Return mean probability and ratio of correct poses by bins of the probability."""
    bins = np.digitize(predicted, _BINS[1:-1])
    return [
        [
            f"{_BINS[one]:g} to {_BINS[one + 1]:g}",
            str((bins == one).sum()),
            f"{predicted[bins == one].mean():.4f}",
            f"{right[bins == one].mean():.4f}",
        ]
        for one in np.unique(bins)
    ]


def draw(path: Path, predicted: Numbers, right: NDArray[np.bool_]) -> None:
    """Write the reliability diagram."""
    from scanlock.report.canvas import save_figure
    from scanlock.report.reliability_figure import reliability_figure

    save_figure(path, reliability_figure(predicted, right, _BINS))


if __name__ == "__main__":
    main()
