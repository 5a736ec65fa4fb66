import numpy as np
import pytest

from scanlock import errors


@pytest.mark.parametrize(
    ("kind", "builtin"),
    [
        (errors.InvalidInput, ValueError),
        (errors.FormatError, ValueError),
        (errors.MissingExtra, ImportError),
    ],
)
def test_each_error_is_also_the_expected_builtin(kind, builtin):
    assert issubclass(kind, errors.ScanlockError)
    assert issubclass(kind, builtin)


@pytest.mark.parametrize("value", [1e-300, 1, np.float32(0.5), np.int64(3)])
def test_positive_values_pass(value):
    errors.require_positive("voxel_size", value)


@pytest.mark.parametrize("value", [0, 0.0, -0.0, -0.5, float("nan"), float("inf"), None, "0.5"])
def test_a_value_that_is_not_positive_is_named_with_its_unit(value):
    with pytest.raises(errors.InvalidInput, match=f"^voxel_size must be positive, got {value} m$"):
        errors.require_positive("voxel_size", value, unit="m")


@pytest.mark.parametrize("value", [3, 3.0, 1e9])
def test_values_at_or_above_the_minimum_pass(value):
    errors.require_at_least("growth", value, 3)


@pytest.mark.parametrize("value", [2.999, float("nan"), float("inf"), None])
def test_a_value_below_the_minimum_is_named_with_both(value):
    message = f"^range must be at least 3 m, got {value} m$"
    with pytest.raises(errors.InvalidInput, match=message):
        errors.require_at_least("range", value, 3, unit="m")


@pytest.mark.parametrize("value", [3, 4, np.int32(3), np.int64(180)])
def test_whole_numbers_pass_as_counts(value):
    errors.require_count("sectors", value, 3)


@pytest.mark.parametrize("value", [2, -1, 3.0, 3.5, np.float64(4), "4", None])
def test_a_count_is_whole_and_not_below_the_minimum(value):
    with pytest.raises(errors.InvalidInput, match="sectors must be a whole number of at least 3"):
        errors.require_count("sectors", value, 3)


@pytest.mark.parametrize("value", [0, 1, 0.5, np.float64(1.0)])
def test_fractions_pass(value):
    errors.require_fraction("overlap", value)


@pytest.mark.parametrize("value", [-1e-12, 1.0000001, float("nan"), float("inf"), "half"])
def test_a_value_outside_zero_to_one_is_not_a_fraction(value):
    with pytest.raises(errors.InvalidInput, match="overlap must lie between 0 and 1"):
        errors.require_fraction("overlap", value)


def test_a_missing_extra_gives_the_command_for_package_and_clone():
    error = errors.missing_extra("LAS needs laspy", "las")
    assert isinstance(error, errors.MissingExtra)
    assert str(error) == (
        'LAS needs laspy: pip install "scanlock[las]", or pip install ".[las]" in a clone'
    )
