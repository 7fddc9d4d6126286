"""The disk cache of kernels follows the modules that are compiled into them."""

import sys
from types import ModuleType

from animator.jit.kernel import kernel


def _module(path, text: str) -> ModuleType:
    path.write_text(text)
    module = ModuleType("inlined")
    module.__file__ = str(path)
    return module


def test_a_changed_dependency_changes_the_name_of_the_cache_file(tmp_path):
    names = []
    for text in ("WIDTH = 1", "WIDTH = 2", "WIDTH = 1"):

        def double(x):
            return 2 * x

        compiled = kernel(depends_on=(_module(tmp_path / "inlined.py", text),))(double)
        assert compiled(21) == 42
        names.append(double.__qualname__)
    assert names[0] == names[2] != names[1]


def test_a_folder_that_cannot_be_written_costs_only_the_cache(tmp_path, monkeypatch):
    from numba.core import caching

    monkeypatch.setattr(caching.CacheImpl, "_locator_classes", [])

    def triple(x):
        return 3 * x

    assert kernel()(triple)(14) == 42


def test_importing_the_package_loads_neither_torch_nor_numba():
    import subprocess

    code = "import sys, animator; print('torch' in sys.modules, 'numba' in sys.modules)"
    result = subprocess.run(
        [sys.executable, "-c", code], check=False, capture_output=True, text=True
    )
    assert result.stdout.split() == ["False", "False"]
