import numpy as np

from scanlock.io import ScanFile
from scanlock.report.labelled_scan import compared_ground, labelled_scan

_LABELS = np.array([0, 0, 1, -1])


def _scan(**fields):
    return ScanFile(points=np.arange(12.0).reshape(4, 3), fields=fields, format="las")


def test_colours_of_the_scan_are_replaced_or_kept():
    own = _scan(red=np.arange(4, dtype=np.uint8), rgba=np.zeros(4, np.uint32))
    coloured, added = labelled_scan(own, _LABELS, ".ply", colours=True)
    assert list(coloured.fields) == ["label", "red", "green", "blue"]
    assert "--no-colours keeps them" in added[-1]
    plain, added = labelled_scan(own, _LABELS, ".ply", colours=False)
    assert list(plain.fields) == ["red", "rgba", "label"]
    assert len(added) == 1
    assert list(labelled_scan(own, _LABELS, ".npz", colours=True)[0].fields) == [
        *own.fields,
        "label",
    ]


def test_classes_of_las_are_kept_unless_they_say_nothing():
    bare, _ = labelled_scan(
        _scan(classification=np.array([0, 1, 0, 1])), _LABELS, ".las", colours=True
    )
    assert list(bare.fields) == ["classification", "label"]
    assert bare.fields["classification"].tolist() == [2, 2, 1, 1]
    rich, added = labelled_scan(
        _scan(classification=np.array([2, 6, 5, 1])), _LABELS, ".las", colours=True
    )
    assert rich.fields["original_classification"].tolist() == [2, 6, 5, 1]
    assert len(added) == 3


def test_ground_is_compared_without_noise():
    found = compared_ground(_scan(classification=np.array([2, 7, 2, 5])), _LABELS)
    assert found == {"points": 2, "agreement": 2 / 3, "recall": 0.5, "precision": 1.0}
    nothing = compared_ground(_scan(classification=np.array([2, 5, 2, 5])), np.array([1, 1, 1, 1]))
    assert nothing["precision"] is None
    assert compared_ground(_scan(classification=np.zeros(4)), _LABELS) is None
    assert compared_ground(_scan(), _LABELS) is None
