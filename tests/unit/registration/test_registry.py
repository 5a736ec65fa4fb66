from dataclasses import dataclass
from importlib.metadata import EntryPoint

import pytest

from reference.samples import street
from scanlock import InvalidInput, Method, Pose, register, register_method
from scanlock.registration import registry
from scanlock.registration.methods.icp.icp import Icp
from scanlock.registration.registry import METHODS, named_method


@pytest.fixture(autouse=True)
def registered(monkeypatch):
    """Restore the registry after each test."""
    monkeypatch.setattr(METHODS, "_methods", dict(METHODS._methods))
    monkeypatch.setattr(METHODS, "_offered", None)


@dataclass(frozen=True)
class _CustomMethod(Method):
    def prepare(self, cloud, log=None):
        return cloud

    def align(self, target, source, start=None, constraints=None):
        raise NotImplementedError


def test_a_registered_method_is_found_by_its_name():
    register_method("icp-fine", Icp(voxel_size=0.2))
    scan = street(1, 2000)
    result = register(source=scan, target=scan, method="icp-fine", initial=Pose.identity())
    assert result.method == "icp-fine"
    assert result.converged


def test_a_registered_name_is_refused_unless_replaced():
    with pytest.raises(InvalidInput, match="replace=True"):
        register_method("gicp", _CustomMethod())
    register_method("gicp", _CustomMethod(), replace=True)
    assert METHODS["gicp"] == _CustomMethod()


@pytest.mark.parametrize("name", ["", "Mine", "my method"])
def test_names_are_lower_case_without_spaces(name):
    with pytest.raises(InvalidInput, match="lower case"):
        register_method(name, _CustomMethod())


@pytest.mark.parametrize("method", [_CustomMethod, object()])
def test_only_objects_with_prepare_and_align_are_methods(method):
    with pytest.raises(InvalidInput):
        register_method("mine", method)


def test_the_mapping_is_read_only():
    with pytest.raises(TypeError):
        METHODS["mine"] = _CustomMethod()


def test_a_method_of_an_installed_package_is_loaded_on_access(monkeypatch):
    loaded = []

    class LoggedEntryPoint(EntryPoint):
        def load(self):
            loaded.append(self.name)
            return _CustomMethod()

    entry_point = LoggedEntryPoint("custom", "package:method", registry.ENTRY_POINTS)
    monkeypatch.setattr(registry, "entry_points", lambda group: [entry_point])
    assert "custom" in list(METHODS)
    assert len(METHODS) == len(list(METHODS))
    assert loaded == []
    assert named_method("custom") == ("custom", _CustomMethod())
    assert loaded == ["custom"]
