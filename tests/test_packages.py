"""Packages: what they offer is there, and stays what it is when their modules are imported."""

from __future__ import annotations

import importlib
import pkgutil
from types import ModuleType

import pytest

import femtune

_MODULES = [module for module in pkgutil.walk_packages(femtune.__path__, "femtune.") if "__main__" not in module.name]
_PACKAGES = ["femtune", *(module.name for module in _MODULES if module.ispkg)]

_OFFERED_MODULES = {"femtune": {"plot", "testing"}}
"""Modules that a package offers as such."""


@pytest.fixture(scope="module", autouse=True)
def _every_module_imported() -> None:
    """An imported module becomes an attribute of its package and hides a name that is spelled alike."""
    for module in _MODULES:
        importlib.import_module(module.name)


@pytest.mark.parametrize("name", _PACKAGES)
def test_no_name_of_a_package_is_that_of_one_of_its_modules(name: str) -> None:
    package = importlib.import_module(name)
    modules = {module.name for module in pkgutil.iter_modules(package.__path__)} - _OFFERED_MODULES.get(name, set())
    assert modules.isdisjoint(getattr(package, "__all__", ()))


@pytest.mark.parametrize("name", _PACKAGES)
def test_a_package_offers_what_it_lists(name: str) -> None:
    package = importlib.import_module(name)
    offered = {each: getattr(package, each) for each in getattr(package, "__all__", ())}
    modules = {each for each, value in offered.items() if isinstance(value, ModuleType)}
    assert modules == _OFFERED_MODULES.get(name, set())
    assert offered.keys() <= set(dir(package))


def test_a_name_that_a_package_lacks_is_an_attribute_error() -> None:
    package = importlib.import_module("femtune.modal")
    with pytest.raises(AttributeError, match=r"module 'femtune\.modal' has no attribute 'nothing'"):
        package.nothing  # noqa: B018
