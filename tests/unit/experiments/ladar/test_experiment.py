import csv
import math
from dataclasses import replace

import numpy as np
import pytest

from reference.studies import contender, record_of
from scanlock.experiments.experiment import Outcome, no_progress
from scanlock.experiments.ladar.claims import ladar_claims, ladar_remarks
from scanlock.experiments.ladar.experiment import LADAR, ladar_contenders
from scanlock.experiments.ladar.outcome import LadarOutcome
from scanlock.experiments.ladar.rows import AS_TAKEN, ROWS, SHIFTED_AND_TURNED, STARTS
from scanlock.experiments.ladar.series import (
    CREEPING,
    DRIVES,
    PARKED,
    WALKING,
    frame_names,
    ladar_pairs,
    ladar_series,
    pairs_of,
    range_image,
)
from scanlock.experiments.reproduce import reproduce
from scanlock.geometry.pose import Pose
from scanlock.pipelines.study import StudyPair, StudyTask
from scanlock.pipelines.study_records import TIMES
from scanlock.registration.methods.icp.icp import Icp
from scanlock.simulation import FacetLadar

pytestmark = pytest.mark.slow

PAPER, OTHER = "ICP 2003", "annealed ICP"


@pytest.fixture(scope="module")
def terrain():
    """Frames at one place; a terrain takes seconds to generate."""
    return ladar_series(1, seed=4)


def _with_two():
    contenders = [contender(PAPER, Icp.madhavan2003()), contender(OTHER, Icp(voxel_size=0.4))]
    return replace(LADAR, contenders=contenders)


@pytest.fixture(scope="module")
def done(terrain, tmp_path_factory):
    return reproduce(_with_two(), terrain, tmp_path_factory.mktemp("ladar"))


def test_each_drive_has_a_pair_with_its_true_motion(terrain):
    pairs = ladar_pairs(terrain)
    assert [(pair.target, pair.source) for pair in pairs] == [frame_names(0, d) for d in DRIVES]
    for drive, pair in zip(DRIVES, pairs, strict=True):
        metres, _ = pair.truth.distance(Pose.identity())
        distance_driven = drive.speed * drive.step / FacetLadar().rate
        # Pitching over bumps moves the ladar more than the vehicle.
        assert 0.5 * distance_driven <= metres <= 2.0 * distance_driven + 1e-4
        assert pairs_of(drive, pairs) == [pair]


def test_range_images_contain_the_points_of_the_frames(terrain):
    for name in terrain.names[:2]:
        image = range_image(terrain.load(name))
        assert image.shape == (32, 180)
        seen = np.isfinite(image).sum()
        assert 0.97 * len(terrain.load(name)) <= seen <= len(terrain.load(name))


def test_starts_equal_those_of_the_paper():
    pose = STARTS.pose(SHIFTED_AND_TURNED, "any", None, np.zeros(3))
    np.testing.assert_array_equal(pose.translation, [3.0, 3.0, 3.0])
    assert pose.distance(Pose.identity())[1] == pytest.approx(math.radians(10.0))
    assert STARTS.pose(AS_TAKEN, "any", None, np.zeros(3)) == Pose.identity()


def test_the_same_experiment_gives_the_same_bytes(terrain, done, tmp_path):
    reproduce(_with_two(), terrain, tmp_path)
    for path in sorted(done.page.parent.rglob("*.*")):
        if path.name == TIMES:
            continue
        assert path.read_bytes() == (tmp_path / path.relative_to(done.page.parent)).read_bytes()


def test_the_page_has_the_four_rows_with_the_numbers_of_the_paper(done):
    folder = done.page.parent
    with (folder / "tables" / "table-1.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["data set"] for row in rows] == [row.name for row in ROWS for _ in range(2)]
    first = rows[0]
    assert float(first["mean distance in the paper [cm]"]) == pytest.approx(5.77)
    # For consecutive frames of a slow vehicle the distance is close to that at the exact pose.
    exact = float(first["at the exact pose [cm]"])
    assert float(first["mean distance [cm]"]) == pytest.approx(exact, rel=0.1)
    assert first["solved"] == "1 / 1"
    page = done.page.read_text()
    for name in ("range-images", "registration", "distances"):
        assert f"(figures/{name}.png)" in page
    assert "two frames of each of four drives" in page
    assert page.count("cannot be decided here: too few places to judge: 1, at least 10") == 6


def test_the_mean_distance_of_the_published_icp_equals_its_own_report(done):
    [record] = [
        one
        for one in done.outcome.records[PAPER]
        if one.task.start == AS_TAKEN and frame_names(0, PARKED)[0] in one.task.pair
    ]
    with (done.page.parent / "tables" / "table-1.csv").open() as file:
        second = list(csv.DictReader(file))[2]
    assert float(second["mean distance [cm]"]) == pytest.approx(
        100.0 * record.mean_distance, rel=0.02
    )


def test_contenders_have_unique_names_and_settings_of_the_paper():
    contenders = ladar_contenders()
    assert len({one.name for one in contenders}) == len(contenders)
    assert contenders[0].method == Icp.madhavan2003()


def _made_up(distances, errors):
    """Two places, every pair from every start, with these distances [m] and errors by method."""
    names = [name for place in range(2) for drive in DRIVES for name in frame_names(place, drive)]
    pairs = [
        StudyPair(target=target, source=source, truth=Pose.identity())
        for target, source in zip(names[::2], names[1::2], strict=True)
    ]
    records = {
        method: [
            replace(
                record_of(pair, method, (error, 0.0)),
                task=StudyTask(pair.name, method, start),
                evaluations=5 + 9 * number,
            )
            for pair in pairs
            for number, start in enumerate(STARTS.names)
        ]
        for method, error in errors.items()
    }
    after = {
        (pair.name, start, method): distance
        for method, distance in distances.items()
        for pair in pairs
        for start in STARTS.names
    }
    outcome = Outcome(series=None, pairs=pairs, records=records)
    exact = {pair.name: 0.04 for pair in pairs}
    return LadarOutcome(outcome, after, exact)


@pytest.mark.parametrize(
    ("distance", "error", "holds"),
    [
        (0.045, 0.1, [True, True, True, True, False, True]),
        (0.05, 0.1, [True, False, False, True, False, True]),
        (0.2, 5.0, [False, False, False, True, False, False]),
    ],
)
def test_claims_follow_from_the_numbers(distance, error, holds):
    found = _made_up({PAPER: distance, OTHER: 0.0}, {PAPER: error, OTHER: 0.0})
    assert [claim.holds for claim in ladar_claims(found, PAPER)] == holds


def test_remarks_compare_each_other_method_with_the_paper():
    found = _made_up({PAPER: 0.2, OTHER: 0.05}, {PAPER: 5.0, OTHER: 0.01})
    [remark] = ladar_remarks(found, PAPER)
    assert remark.startswith(f"{OTHER} is within the paper's mean distance on #1, #4.")
    assert (
        "solves #4 at 2 of 2 places with a mean distance of 5.00 cm, within the 5.77 cm" in remark
    )


def test_records_are_found_by_drive_and_start():
    found = _made_up({PAPER: 0.05}, {PAPER: 0.1})
    for drive in (CREEPING, WALKING):
        records = found.records(drive, AS_TAKEN, PAPER)
        assert [r.task.pair for r in records] == [pair.name for pair in found.pairs(drive)]
        assert {r.task.start for r in records} == {AS_TAKEN}
        assert found.solved(drive, AS_TAKEN, PAPER) == found.places == 2


def test_the_analysis_reports_progress(done, terrain):
    seen = []

    def progress(items, count, task):
        seen.append((task, count))
        return no_progress(items, count, task)

    LADAR.analyse(done.outcome, progress)
    assert seen == [("measuring distances", len(DRIVES))]
