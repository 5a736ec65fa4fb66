import math
from dataclasses import fields

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scanlock.registration.verification import probability as confidence
from scanlock.registration.verification.metrics import Metrics
from scanlock.registration.verification.observability import DirectionObservability
from scanlock.registration.verification.probability import FEATURES, features, probability

_GOOD = {
    "overlap": 0.95, "target_overlap": 0.9, "score": 0.7, "inlier_rmse": 0.05,
    "roughness": 0.05, "misfit": 0.1, "surface_overlap": 0.6, "drift": 0.02,
    "violation": 0.02, "second_best": 0.2,
}  # fmt: skip


def _directions(turn=0.001, ratio=0.2):
    axes = np.eye(3)
    return tuple(
        DirectionObservability(
            kind, axes[i], ratio, 0.01 if kind == "translation" else turn / (1 + i)
        )
        for kind in ("translation", "rotation")
        for i in range(3)
    )


def test_the_model_has_a_weight_for_each_number():
    assert len(confidence.WEIGHTS) == len(FEATURES) == len(features(Metrics(), ()))


def test_the_probability_is_that_of_the_formula():
    metrics = Metrics(**_GOOD)
    seen = features(metrics, _directions())
    expected = [
        0.02, 0.1, math.log(0.02 / 0.05), math.log(0.001), math.log(1.05 - 0.2), 0.0,
    ]  # fmt: skip
    np.testing.assert_allclose(seen, expected)
    logit = confidence.INTERCEPT + np.dot(confidence.WEIGHTS, expected)
    assert probability(metrics, _directions()) == pytest.approx(1.0 / (1.0 + math.exp(-logit)))


def test_scans_that_agree_are_right_and_scans_that_do_not_are_wrong():
    assert probability(Metrics(**_GOOD), _directions()) > 0.99
    bad = {**_GOOD, "overlap": 0.3, "target_overlap": 0.3, "score": 0.15, "inlier_rmse": 0.2,
           "misfit": 0.6, "drift": 0.2, "violation": 0.3, "second_best": 0.9}  # fmt: skip
    assert probability(Metrics(**bad), _directions(0.01, 0.06)) < 0.05
    assert probability(Metrics(), ()) < 0.01


_NUMBERS = st.floats(min_value=0.0, max_value=1e9) | st.just(math.nan)


@given(st.tuples(*[_NUMBERS] * len(fields(Metrics))), st.booleans())
def test_whatever_the_numbers_it_is_a_probability(values, is_held):
    names = [field.name for field in fields(Metrics)]
    found = probability(
        Metrics(**dict(zip(names, values, strict=True))), _directions() if is_held else ()
    )
    assert 0.0 <= found <= 1.0


@pytest.mark.parametrize(
    ("name", "better", "worse"),
    [
        ("misfit", 0.1, 0.6), ("violation", 0.0, 0.3), ("drift", 0.01, 0.2),
        ("roughness", 0.2, 0.03), ("second_best", 0.2, 0.95),
    ],
)  # fmt: skip
def test_what_speaks_for_a_pose_makes_it_more_probable(name, better, worse):
    found = [
        probability(Metrics(**{**_GOOD, name: value}), _directions()) for value in (better, worse)
    ]
    assert found[0] > found[1]


def test_what_holds_a_pose_makes_it_more_probable():
    firm = probability(Metrics(**_GOOD), _directions(0.001))
    assert probability(Metrics(**_GOOD), _directions(0.01)) < firm
    assert probability(Metrics(**_GOOD), _directions(0.001, ratio=0.001)) < firm
