"""Fields of other formats as LAS dimensions."""

import numpy as np
import pytest

from scanlock.io import ScanFile, read_scan, write_scan
from scanlock.io.formats.las.fitted import fitted_to_las

_POINTS = np.random.default_rng(0).normal(size=(4, 3))


def _scan(**fields):
    return ScanFile(points=_POINTS, fields=fields, format="bin")


@pytest.mark.parametrize(
    ("values", "expected"),
    [([0.0, 0.5, 1.0, np.nan], [0, 32768, 65535, 0]), ([0.0, 7.4, 255.0, -3.0], [0, 7, 255, 0])],
)
def test_intensities_are_scaled_and_kept_as_they_were(tmp_path, values, expected):
    values = np.array(values, np.float32)
    path = tmp_path / "scan.las"
    write_scan(path, fitted_to_las(_scan(intensity=values)))
    again = read_scan(path)
    assert again.fields["intensity"].tolist() == expected
    np.testing.assert_array_equal(again.fields["intensity_float"], values)


def test_colours_have_sixteen_bits():
    fitted = fitted_to_las(_scan(red=np.array([0, 1, 128, 255], np.uint8)))
    assert fitted.fields["red"].tolist() == [0, 257, 128 * 257, 65535]


def test_whole_numbers_and_other_fields_stay():
    ring, intensity = np.arange(4, dtype=np.uint8), np.arange(4, dtype=np.uint16)
    fitted = fitted_to_las(_scan(ring=ring, intensity=intensity))
    assert fitted.fields["ring"] is not None
    assert fitted.fields["intensity"].tolist() == [0, 1, 2, 3]
    assert set(fitted.fields) == {"ring", "intensity"}
