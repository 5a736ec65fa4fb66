import numpy as np
import pytest

from reference.samples import street, yaw_pose
from scanlock.errors import InvalidInput
from scanlock.registration.register import register
from scanlock.registration.registry import DEFAULT_METHOD, METHODS
from scanlock.registration.verification.status import Status
from scanlock.timing import StageClock


@pytest.fixture(scope="module")
def scan():
    return street(1, 3000)


def test_the_default_method_has_a_name(scan):
    assert register(source=scan, target=scan).method == DEFAULT_METHOD
    assert DEFAULT_METHOD in METHODS


@pytest.mark.parametrize(
    ("initial", "message"),
    [
        (np.zeros((2, 2)), "initial must have shape"),
        (2.0 * np.eye(4), "pose"),
        (np.diag([1.0, 1.0, -1.0, 1.0]), "must be a rotation"),
        (np.full((4, 4), np.nan), "must be finite"),
        ("identity", "must hold real numbers"),
    ],
)
def test_an_initial_pose_that_is_none_is_refused(scan, initial, message):
    with pytest.raises(InvalidInput, match=message):
        register(source=scan, target=scan, initial=initial)


def test_an_initial_pose_with_few_digits_is_mended_and_noted(scan):
    exact = yaw_pose(0.3, (0.1, 0.2, 0.0)).matrix
    notes = {
        digits: [note for note in register(source=scan, target=scan, initial=exact.round(digits)).notes
                 if note.startswith("initial")]
        for digits in (3, 12)
    }  # fmt: skip
    assert not notes[12]
    [note] = notes[3]
    defect = float(note.split(" was ")[1].split()[0])
    assert 1e-5 < defect < 1e-3
    assert not any(note.startswith("initial") for note in register(source=scan, target=scan).notes)


def test_source_and_target_are_never_confused(scan):
    motion = yaw_pose(0.3, (3.0, 1.0, 0.0))
    result = register(source=motion.inverse().apply(scan), target=scan)
    # The pose carries the source onto the target, not the other way round.
    moved = result.target_from_source.apply(motion.inverse().apply(scan))
    assert np.median(np.linalg.norm(moved - scan, axis=1)) < 0.1


def test_a_scan_of_too_few_parts_is_named_in_the_reason(scan):
    few = np.concatenate([np.full((9, 3), [x, 5.0, 0.0]) for x in (5.0, 15.0)])
    result = register(source=few, target=scan)
    assert result.status is Status.NO_CORRESPONDENCES
    assert result.reason.startswith("the source holds 2 parts")


def test_settings_of_ones_own_go_by_the_name_of_their_class(scan):
    class Standing(type(METHODS[DEFAULT_METHOD])):
        """The default method under another name."""

    assert register(source=scan, target=scan, method=Standing()).method == "Standing"


def test_a_clock_adds_up_what_is_spent_under_a_name():
    clock = StageClock()
    for _ in range(2):
        with clock.stage("one"):
            pass
    first = clock.seconds["one"]
    with pytest.raises(ZeroDivisionError), clock.stage("one"):
        _ = 1 / 0
    assert clock.seconds["one"] > first > 0.0
