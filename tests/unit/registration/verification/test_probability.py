import math
from dataclasses import fields

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scanlock.registration.verification.metrics import Metrics
from scanlock.registration.verification.observability import DirectionObservability
from scanlock.registration.verification.probability import (
    FEATURES,
    INTERCEPT,
    WEIGHTS,
    model_inputs,
    probability,
)

_GOOD = {
    "overlap": 0.95, "target_overlap": 0.9, "score": 0.7, "inlier_rmse": 0.05, "roughness": 0.05,
    "outlier_ratio": 0.1, "fitness": 0.6, "refinement_shift": 0.02, "free_space_violation": 0.02,
    "runner_up_ratio": 0.2, "object_log_odds": 12.0, "self_similarity": 0.3,
}  # fmt: skip
_BAD = {
    **_GOOD, "overlap": 0.3, "target_overlap": 0.3, "score": 0.15, "inlier_rmse": 0.2,
    "outlier_ratio": 0.6, "refinement_shift": 0.2, "free_space_violation": 0.3,
    "runner_up_ratio": 0.9, "object_log_odds": -20.0, "self_similarity": 0.6,
}  # fmt: skip


def _directions(rotation_deviation=0.001, ratio=0.2):
    return tuple(
        DirectionObservability(kind=kind, axis=axis, ratio=ratio, deviation=deviation / (1 + i))
        for kind, deviation in (("translation", 0.01), ("rotation", rotation_deviation))
        for i, axis in enumerate(np.eye(3))
    )


def test_the_model_has_a_weight_for_each_feature():
    assert len(WEIGHTS) == len(FEATURES) == len(model_inputs(Metrics(), ()))


def test_the_probability_is_the_logistic_function_of_the_features():
    metrics = Metrics(**_GOOD)
    expected = [
        0.02, 0.1, math.log(0.02 / 0.05), math.log(0.001), math.log(1.05 - 0.2), 0.0,
        1.0,
    ]  # fmt: skip
    np.testing.assert_allclose(model_inputs(metrics, _directions()), expected)
    logit = INTERCEPT + np.dot(WEIGHTS, expected)
    assert probability(metrics, _directions()) == pytest.approx(1.0 / (1.0 + math.exp(-logit)))


def test_good_metrics_are_probable_and_bad_or_unknown_ones_are_not():
    assert probability(Metrics(**_GOOD), _directions()) > 0.95
    assert probability(Metrics(**_BAD), _directions(0.01, 0.06)) < 0.05
    assert probability(Metrics(), ()) < 0.01


_NUMBERS = st.floats(min_value=0.0, max_value=1e9) | st.just(math.nan)


@given(st.tuples(*[_NUMBERS] * len(fields(Metrics))), st.booleans())
def test_any_metrics_give_a_number_between_zero_and_one(values, has_directions):
    names = [field.name for field in fields(Metrics)]
    metrics = Metrics(**dict(zip(names, values, strict=True)))
    assert 0.0 <= probability(metrics, _directions() if has_directions else ()) <= 1.0


@pytest.mark.parametrize(
    ("name", "better", "worse"),
    [
        ("outlier_ratio", 0.1, 0.6), ("free_space_violation", 0.0, 0.3),
        ("refinement_shift", 0.01, 0.2), ("roughness", 0.2, 0.03), ("runner_up_ratio", 0.2, 0.95),
        ("object_log_odds", 0.5, -5.0),
    ],
)  # fmt: skip
def test_better_metrics_are_more_probable(name, better, worse):
    found = [
        probability(Metrics(**{**_GOOD, name: value}), _directions()) for value in (better, worse)
    ]
    assert found[0] > found[1]


def test_constrained_poses_are_more_probable():
    constrained = probability(Metrics(**_GOOD), _directions(0.001))
    assert probability(Metrics(**_GOOD), _directions(0.01)) < constrained
    assert probability(Metrics(**_GOOD), _directions(0.001, ratio=0.001)) < constrained
