import numpy as np

from scanlock.report.basin_figure import Basin, basin_figure
from scanlock.report.pictures import save_pictures


def _figure():
    return basin_figure({"a": Basin(np.array([[1]]), np.array([[2]]))}, [1.0], [0.0])


def test_the_same_figure_gives_the_same_bytes(tmp_path):
    written = []
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        written.append(save_pictures(tmp_path / name, "basin", _figure()))
    assert [path.name for path in written[0]] == ["basin.png", "basin.svg"]
    for one, other in zip(*written, strict=True):
        assert one.read_bytes() == other.read_bytes()


def test_files_tell_neither_the_day_nor_the_program(tmp_path):
    png, svg = save_pictures(tmp_path, "basin", _figure())
    assert b"Software" not in png.read_bytes()
    assert b"Matplotlib v" not in svg.read_bytes()
    assert b"dc:date" not in svg.read_bytes()
