"""Registries, and modules of users that add to them."""

import pytest

from towval.model import plugins
from towval.model.errors import InputError
from towval.model.plugins import Registry


@pytest.fixture
def load(monkeypatch):
    """A function that loads the plugins which the variable lists, in a fresh state."""

    def load(listed):
        monkeypatch.setenv(plugins.VARIABLE, listed)
        plugins.load_plugins.cache_clear()
        return plugins.load_plugins()

    yield load
    plugins.load_plugins.cache_clear()


def test_a_registry_keeps_order_and_refuses_a_name_twice():
    registry = Registry("law")
    registry.register("b", 1)
    registry.register("a", 2)
    assert list(registry.items()) == [("b", 1), ("a", 2)]
    with pytest.raises(InputError, match="law 'a' is registered twice"):
        registry.register("a", 3)
    with pytest.raises(InputError, match=r"friction\.law names an unknown law(.|\n)*allowed: b, a"):
        registry.require("c", "friction.law")


def test_plugins_are_files_or_modules_and_are_imported_once(load, tmp_path, monkeypatch):
    (tmp_path / "one_plugin.py").write_text("import builtins\nbuiltins.towval_loads = 1\n")
    (tmp_path / "other_plugin.py").write_text("import one_plugin\n")
    monkeypatch.syspath_prepend(tmp_path)
    assert load("") == ()
    found = load(f"{tmp_path}/one_plugin.py, other_plugin")
    assert [path.name for path in found] == ["one_plugin.py", "other_plugin.py"]
    assert plugins.load_plugins() is found


@pytest.mark.parametrize("listed", ["no_such_module_here", "no_such_file.py"])
def test_a_plugin_that_cannot_be_imported_is_named(load, listed):
    with pytest.raises(InputError, match=f"the plugin {listed} cannot be imported(.|\n)*TOWVAL_PLUGINS"):
        load(listed)


@pytest.mark.parametrize("name", ["json", "statistics", "scipy"])
def test_a_plugin_does_not_take_the_place_of_another_module(load, tmp_path, name):
    """A plugin json.py was what the package imported as json from then on: it ended with a traceback."""
    (tmp_path / f"{name}.py").write_text("MU = 0.3\n")
    with pytest.raises(InputError, match=f"another module is named {name}: rename the file"):
        load(f"{tmp_path}/{name}.py")


def test_a_plugin_that_fails_says_how(load, tmp_path):
    (tmp_path / "broken.py").write_text("1 / 0\n")
    with pytest.raises(InputError, match="ZeroDivisionError"):
        load(f"{tmp_path}/broken.py")


def test_all_files_of_a_package_belong_to_its_plugin(load, tmp_path, monkeypatch):
    """A law may stand beside the module that registers it."""
    (tmp_path / "lab_plugin").mkdir()
    (tmp_path / "lab_plugin" / "__init__.py").write_text("from lab_plugin.law import MU\n")
    (tmp_path / "lab_plugin" / "law.py").write_text("MU = 0.3\n")
    monkeypatch.syspath_prepend(tmp_path)
    assert [path.name for path in load("lab_plugin")] == ["__init__.py", "law.py"]
