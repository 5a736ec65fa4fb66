import numpy as np

from scanlock.arrays import read_only
from scanlock.kernels.points.morton import morton_codes


def test_codes_interleave_the_bits_of_the_cells():
    # The corners come first, so the cells are those of the integers up to 1023.
    cells = np.random.default_rng(0).integers(0, 1024, (200, 3))
    cells[:2] = [[0, 0, 0], [1023, 1023, 1023]]
    expected = [
        sum(((int(c) >> bit) & 1) << (3 * bit + a) for bit in range(10) for a, c in enumerate(cell))
        for cell in cells
    ]
    assert morton_codes(read_only(cells.astype(float))).tolist() == expected


def test_neighbours_along_the_curve_are_close_in_space():
    points = np.random.default_rng(1).uniform(0.0, 1.0, (4000, 3))
    ordered = points[np.argsort(morton_codes(read_only(points)))]
    steps = np.linalg.norm(np.diff(ordered, axis=0), axis=1)
    assert np.median(steps) < 0.2 * np.median(np.linalg.norm(np.diff(points, axis=0), axis=1))


def test_equal_points_have_code_zero_and_no_points_no_codes():
    assert morton_codes(read_only(np.full((3, 3), 7.0))).tolist() == [0, 0, 0]
    assert len(morton_codes(read_only(np.empty((0, 3))))) == 0
