import json
from dataclasses import replace

import pytest

from scanlock import AnnealedStart, InvalidInput
from scanlock.cli.method_options import MethodOptions
from scanlock.registration.registry import DEFAULT_METHOD, METHODS
from scanlock.registration.settings.file import settings_from_toml


@pytest.mark.parametrize("options", [[], ["--all"]])
def test_printed_settings_equal_those_of_the_method(scanlock, options):
    for name, method in METHODS.items():
        done = scanlock("settings", name, *options)
        assert done.code == 0
        assert settings_from_toml(done.out) == method


def test_the_first_settings_fit_on_a_screen(scanlock):
    short, whole = (scanlock("settings", "auto", *more).out for more in ([], ["--all"]))
    assert len(short.splitlines()) < 50 < len(whole.splitlines())
    assert "scanlock settings auto --all" in short
    assert "search.headings = 92" in short


def test_single_settings_are_changed_on_the_command_line(scanlock, scans, tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text('method = "icp"\nneighbours = 12\n')
    changes = ("voxel_size=0.4", "annealing=AnnealedStart", "annealing.seed=7")
    expected = replace(
        METHODS["icp"], neighbours=12, voxel_size=0.4, annealing=AnnealedStart(seed=7)
    )
    assert MethodOptions(settings=path, changes=changes).chosen() == expected
    assert MethodOptions(method="icp").chosen() == "icp"
    with pytest.raises(InvalidInput, match=r"--set: voxelsize is not .*; did you mean voxel_size"):
        MethodOptions(method="icp", changes=("voxelsize=1",)).chosen()


def test_written_settings_can_be_used_in_a_registration(scanlock, scans, tmp_path):
    path = tmp_path / "mine.toml"
    assert scanlock("settings", "sgc-ndt-p2d", "-o", path).out == f"wrote {path}\n"
    path.write_text(path.read_text().replace("voxel_size = 0.5", "voxel_size = 0.4"))
    pair = (scans / "source.npy", scans / "target.npy")
    found = json.loads(scanlock("register", *pair, "--settings", path, "--json").out)
    assert found["method"] == "SgcNdt"
    default = json.loads(scanlock("register", *pair, "--json").out)
    assert default["method"] == DEFAULT_METHOD
    assert default["target_from_source"] != found["target_from_source"]


def test_invalid_settings_are_an_error_of_one_line(scanlock, scans, tmp_path):
    pair = (scans / "source.npy", scans / "target.npy")
    path = tmp_path / "mine.toml"
    path.write_text('type = "SgcNdt"\nvoxel_size = -1\n')
    done = scanlock("register", *pair, "--settings", path)
    assert done.code == 1
    assert "voxel_size must be positive, got -1.0 m" in done.err
    assert done.err.count("\n") == 1
    both = scanlock("register", *pair, "--settings", path, "--method", "gicp")
    assert "either --method or --settings" in both.err
    assert "must end in .toml" in scanlock("settings", "gicp", "-o", tmp_path / "x.txt").err
