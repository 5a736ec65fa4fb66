import pytest

from scanlock import METHODS, Gicp, Icp, NdtD2d
from scanlock.registration.methods.icp.correspondences import VoxelSearch
from scanlock.registration.settings.file import settings_from_toml
from scanlock.registration.settings.key_settings import (
    KEY_SETTINGS,
    key_settings,
    key_settings_to_toml,
)


@pytest.mark.parametrize("name", METHODS)
def test_at_most_twelve_settings_are_printed_and_read_back(name):
    text = key_settings_to_toml(name)
    assert settings_from_toml(text) == METHODS[name]
    assert 10 <= len(key_settings(METHODS[name])) <= 12
    assert text.count("\n\n") == len(key_settings(METHODS[name]))


def test_every_listed_setting_exists():
    classes = {type(method) for method in METHODS.values()}
    assert set(KEY_SETTINGS) == classes
    for kind, keys in KEY_SETTINGS.items():
        found = {
            key
            for method in METHODS.values()
            if isinstance(method, kind)
            for key in key_settings(method)
        }
        assert found == set(keys)


def test_settings_of_another_search_are_left_out():
    assert "search.voxel_sizes" not in key_settings(Gicp())
    assert "search.voxel_sizes" in key_settings(Gicp(search=VoxelSearch()))


def test_a_method_of_another_class_has_its_plain_settings():
    class Mine(NdtD2d):
        pass

    assert "cell_sizes" in key_settings(Mine())
    assert "grid" not in key_settings(Mine())


def test_comments_list_the_alternatives_of_none():
    text = key_settings_to_toml("icp")
    assert '# One of AnnealedStart, "none".\n# annealing = "none"\n' in text
    assert '# Either a number or "none".\nvoxel_size = 0.5\n' in text
    assert Icp().annealing is None
