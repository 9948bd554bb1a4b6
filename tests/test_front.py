"""What `import nrdob` and its subpackages show, and nothing besides."""

import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

import nrdob

SUBPACKAGES = sorted(path.parent.name for path in Path(nrdob.__file__).parent.glob("*/__init__.py"))
MOST = 25


@pytest.mark.parametrize("name", ["nrdob", *(f"nrdob.{each}" for each in SUBPACKAGES)])
def test_dir_shows_the_public_names_and_nothing_else(name):
    package = import_module(name)
    assert dir(package) == sorted(package.__all__)
    for public in package.__all__:
        assert hasattr(package, public) or import_module(f"{name}.{public}")


def test_the_package_shows_few_names():
    assert len(nrdob.__all__) <= MOST
    assert len(SUBPACKAGES) > 8


@pytest.mark.slow
def test_the_package_loads_no_figures_no_course_and_no_algebra_and_a_plot_no_diagrams():
    code = (
        "import sys, nrdob\n"
        "unasked = {'nrdob.plotting', 'nrdob_course', 'nrdob.reporting', 'sympy', 'jinja2'}\n"
        "loaded = unasked & set(sys.modules)\n"
        "import nrdob.plotting.bodeplot\n"
        "loaded |= {'schemdraw', 'sympy'} & set(sys.modules)\n"
        "sys.exit(', '.join(loaded) or 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, encoding="utf-8")
    assert done.returncode == 0, f"import nrdob, or a plot, loads {done.stderr}"
