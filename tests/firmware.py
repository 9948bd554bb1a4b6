"""Generated controllers made to run: the C compiled by cc, the Python class by itself."""

from __future__ import annotations

import ctypes
import functools
import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np
import pytest

STRICT = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-O2"]

HARNESS = """
void run(int n, const double *r, const double *y, const double *applied,
         int started, double u0, double *u, double *limited, double *d_hat)
{{
    static {name}_state s;
    if (started)
        {name}_start(&s, ({name}_real)r[0], ({name}_real)y[0], ({name}_real)u0);
    else
        {name}_init(&s);
    for (int k = 0; k < n; k++) {{
        limited[k] = (double){name}_output(&s, ({name}_real)r[k], ({name}_real)y[k]);
        u[k] = (double)s.u;
        {name}_update(&s, ({name}_real)applied[k]);
        d_hat[k] = (double)s.d_hat;
    }}
}}
void chain(int n, const double *r, const double *y, double *u)
{{
    static {name}_state s;
    {name}_init(&s);
    for (int k = 0; k < n; k++)
        u[k] = (double){name}_step(&s, ({name}_real)r[k], ({name}_real)y[k]);
}}
"""


@functools.cache
def compiler() -> str:
    found = shutil.which("cc")
    if not found:
        pytest.skip("there is no C compiler (cc) here: the generated C was NOT compiled or run")
    return found


def compiled(text: str, name: str) -> ctypes.CDLL:
    """Compile without a single warning, and load."""
    cc = compiler()
    folder = Path(tempfile.mkdtemp())
    try:
        # The file as it is written stands alone; the harness is of the test.
        (folder / "alone.c").write_text(text, encoding="utf-8")
        (folder / "run.c").write_text(text + HARNESS.format(name=name), encoding="utf-8")
        for arguments in (["-c", "alone.c"], ["-shared", "-fPIC", "-o", "run.so", "run.c"]):
            done = subprocess.run([cc, *STRICT, *arguments], cwd=folder, capture_output=True,
                                  text=True, check=False)  # fmt: skip
            assert done.returncode == 0, done.stderr
        return ctypes.CDLL(str(folder / "run.so"))
    finally:
        shutil.rmtree(folder)


def run_c(text, name, r, y, applied, start=None):
    """Return u, what the limits inside make of it, and d_hat, for given r, y and applied u."""
    library = compiled(text, name)
    pointer = ctypes.POINTER(ctypes.c_double)
    given = [np.ascontiguousarray(v, dtype=float) for v in (r, y, applied)]
    found = [np.zeros(len(r)) for _ in range(3)]
    library.run(
        ctypes.c_int(len(r)), *(v.ctypes.data_as(pointer) for v in given),
        ctypes.c_int(start is not None), ctypes.c_double(start or 0.0),
        *(v.ctypes.data_as(pointer) for v in found),
    )  # fmt: skip
    return found


def python_class(text, name="Controller"):
    """Return the class that the text defines, which finds nothing of this package."""
    namespace: dict[str, object] = {}
    exec(compile(text, name, "exec"), namespace)
    return namespace[name]


def run_python(text, r, y, applied, start=None):
    controller = python_class(text)()
    if start is not None:
        controller.start(r[0], y[0], start)
    rows = []
    for reference, measurement, done in zip(r.tolist(), y.tolist(), applied.tolist(), strict=True):
        limited = controller.output(reference, measurement)
        controller.update(done)
        rows.append((controller.u, limited, controller.d_hat))
    return np.array(rows).T


def relative(found, expected, terms=0.0):
    """Largest difference, against the largest value (or the largest terms of it) until then."""
    size = np.maximum.accumulate(np.maximum(np.abs(expected), np.abs(terms)))
    return float(np.max(np.abs(found - expected) / np.where(size > 0, size, 1)))
