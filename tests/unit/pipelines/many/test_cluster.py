import importlib
import os
import signal
import threading
import time

import pytest

from reference.pair_readers import read_or_die, read_slowly
from reference.samples import street, yaw_pose
from scanlock import InvalidInput, MissingExtra, register_many
from scanlock.io import write_scan
from scanlock.pipelines.many import cluster


@pytest.fixture(scope="module")
def pairs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("cluster")
    for k in range(4):
        pose = yaw_pose(0.05 * k, (0.4 * k, 0.0, 0.0))
        write_scan(folder / f"{k}.npy", pose.inverse().apply(street(k + 1, 3000)))
    write_scan(folder / "killer.npy", street(1, 3000))
    return [(folder / f"{a}.npy", folder / f"{b}.npy") for a in range(4) for b in range(a)]


@pytest.fixture(scope="module")
def two_workers():
    distributed = pytest.importorskip("distributed")
    dask = importlib.import_module("dask")
    # By default, a local cluster gives up a worker that is not back after 15 s, or that is dead
    # 15 s after an earlier death.
    patience = dask.config.set({"distributed.deploy.lost-worker-timeout": "10 minutes"})
    with (
        patience,
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, dashboard_address=None
        ) as found,
    ):
        yield found


def test_a_cluster_without_dask_says_what_to_install(monkeypatch):
    def missing(name):
        raise ImportError(name)

    monkeypatch.setattr(importlib, "import_module", missing)
    with pytest.raises(MissingExtra, match=r"pip install 'scanlock\[cluster\]'"):
        register_many([], executor="tcp://localhost:1")


@pytest.mark.parametrize(
    ("executor", "expected"),
    [("tcp://host:8786", True), ("tls://host:1", True), ("threads", False), (None, False)],
)
def test_an_address_is_recognised(executor, expected):
    assert cluster.is_address(executor) is expected


@pytest.mark.cluster
@pytest.mark.filterwarnings("default")
def test_an_address_without_a_scheduler_is_named(monkeypatch):
    pytest.importorskip("distributed")
    with pytest.raises(InvalidInput, match=r"got tcp://127\.0\.0\.1:9, where none answers"):
        register_many([], executor="tcp://127.0.0.1:9")


@pytest.mark.cluster
@pytest.mark.filterwarnings("default")
def test_a_cluster_gives_the_rows_of_one_thread(two_workers, pairs):
    one = list(register_many(pairs, executor=None))
    assert list(register_many(pairs, executor=two_workers.scheduler_address)) == one
    client = two_workers.get_client()
    assert list(register_many(pairs, executor=client)) == one
    assert client.status == "running"
    client.close()


@pytest.mark.cluster
@pytest.mark.filterwarnings("default")
def test_a_worker_killed_midway_costs_no_row(two_workers, pairs):
    one = list(register_many(pairs, executor=None)) * 20
    address = two_workers.scheduler_address
    processes = [worker.process.pid for worker in two_workers.workers.values()]

    def kill():
        time.sleep(1.5)
        os.kill(processes[0], signal.SIGKILL)

    killer = threading.Thread(target=kill)
    killer.start()
    rows = list(register_many(pairs * 20, executor=address, read=read_slowly, cache_bytes=0))
    killer.join()
    assert rows == one
    client = two_workers.get_client()
    client.wait_for_workers(2, timeout=60)
    assert processes[0] not in [worker.process.pid for worker in two_workers.workers.values()]
    client.close()


@pytest.mark.cluster
@pytest.mark.filterwarnings("default")
def test_a_pair_that_ends_every_worker_is_a_row_and_the_others_are_kept(two_workers, pairs):
    folder = pairs[0][0].parent
    some = [*pairs[:3], (folder / "killer.npy", folder / "0.npy"), *pairs[3:]]
    rows = list(register_many(some, executor=two_workers.scheduler_address, read=read_or_die))
    assert [row.error for row in rows] == ["", "", "", "WorkerDied", "", "", ""]
