from dataclasses import dataclass

import numpy as np
import pytest

from reference.samples import street, yaw_pose
from scanlock.cli import main
from scanlock.io import write_scan

MOTION = yaw_pose(0.15, (1.2, -0.6, 0.0))


@dataclass(frozen=True)
class Done:
    code: int
    out: str
    err: str


@pytest.fixture
def scanlock(capsys):
    """Return a function that runs the command line in this process, without a terminal."""

    def run(*arguments):
        capsys.readouterr()
        code = main([str(argument) for argument in arguments])
        out, err = capsys.readouterr()
        return Done(code, out, err)

    return run


@pytest.fixture(scope="session")
def scans(tmp_path_factory):
    """Return a folder of scans: two of one scene with a known motion, one with invalid rows."""
    folder = tmp_path_factory.mktemp("scans")
    target, source = street(1), MOTION.inverse().apply(street(2))
    write_scan(folder / "target.npy", target)
    write_scan(folder / "source.npy", source)
    write_scan(folder / "elsewhere.npy", street(3, layout=7))
    write_scan(folder / "float32.bin", target.astype(np.float32))
    invalid = target.copy()
    invalid[::10] = np.nan
    invalid[5::10] = 0.0
    intensity = np.arange(len(invalid), dtype=np.float32)
    write_scan(folder / "invalid_rows.pcd", invalid, {"intensity": intensity}, height=10)
    np.save(folder / "truth.npy", MOTION.matrix)
    (folder / "cut.bin").write_bytes((folder / "float32.bin").read_bytes()[:-7])
    (folder / "noise.ply").write_bytes(b"ply\nformat binary_little_endian 1.0\n\xff\xff")
    return folder
