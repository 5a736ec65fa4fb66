"""A toy series, and outcomes of made-up errors."""

import pytest

from reference.studies import record_of, toy_series
from scanlock.experiments.experiment import Outcome


@pytest.fixture(scope="session")
def series():
    return toy_series()


@pytest.fixture
def outcome_of(series):
    """Return a maker of outcomes from errors (m, rad) of each pair by method."""

    def make(errors, series=series):
        pairs = series.pairs()
        return Outcome(
            series=series,
            pairs=pairs,
            records={
                name: [
                    record_of(pair, name, error) for pair, error in zip(pairs, values, strict=True)
                ]
                for name, values in errors.items()
            },
        )

    return make
