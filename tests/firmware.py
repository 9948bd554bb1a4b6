"""Generated controllers made to run: the C compiled by cc, the Python class by itself."""

from __future__ import annotations

import contextlib
import ctypes
import functools
import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np
import pytest

COMPILERS = ("gcc", "clang")

STRICT = [
    "-std=c99", "-O2", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wshadow",
    "-Wdouble-promotion", "-Wmissing-prototypes", "-Werror",
]  # fmt: skip

SANITIZED = ["-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]

HARNESS = """
#include "{name}.h"
void run(int n, const double *r, const double *y, const double *applied,
         int started, double u0, double *u, double *limited, double *d_hat);
void run(int n, const double *r, const double *y, const double *applied,
         int started, double u0, double *u, double *limited, double *d_hat)
{{
    {name}_state s;
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
"""

STEPWISE = """
#include "{name}.h"
static {name}_state s;
void begin(void);
double output(double r, double y);
void update(double applied);
void begin(void) {{ {name}_init(&s); }}
double output(double r, double y)
{{
    return (double){name}_output(&s, ({name}_real)r, ({name}_real)y);
}}
void update(double applied) {{ {name}_update(&s, ({name}_real)applied); }}
"""

TWO = """
#include <stdio.h>
#include "{name}.h"
/* Two instances in turn, each with a reference and a measurement of its own, from stdin. */
int main(void)
{{
    {name}_state s[2];
    double in[4];
    {name}_init(&s[0]);
    {name}_init(&s[1]);
    while (fread(in, sizeof in[0], 4, stdin) == 4) {{
        for (int i = 0; i < 2; i++) {{
            const {name}_real r = ({name}_real)in[2 * i], y = ({name}_real)in[2 * i + 1];
            const {name}_real u = {name}_step(&s[i], r, y);
            printf("%.17g %lu ", (double)u, (unsigned long)s[i].skipped);
        }}
    }}
    return 0;
}}
"""


@functools.cache
def compiler(name: str = "cc") -> str:
    found = shutil.which(name)
    if not found:
        pytest.skip(f"there is no C compiler {name} here: the generated C was NOT compiled or run")
    return found


@contextlib.contextmanager
def built(cc, sampled, name, dtype, harness, *options, **made):
    """Compile file and harness, which knows the header alone, without a single warning."""
    with tempfile.TemporaryDirectory() as folder:
        for file, text in (
            (f"{name}.c", sampled.code(**made).to_c(name, dtype)),
            (f"{name}.h", sampled.code().to_header(name, dtype)),
            ("harness.c", harness.format(name=name)),
        ):
            (Path(folder) / file).write_text(text, encoding="utf-8")
        done = subprocess.run([compiler(cc), *STRICT, *options, "-o", "out", "harness.c",
                               f"{name}.c"], cwd=folder, capture_output=True, text=True,
                              check=False)  # fmt: skip
        assert done.returncode == 0, done.stderr
        yield Path(folder) / "out"


@functools.cache
def sanitizers(cc: str) -> None:
    """Skip where the compiler is there, but not what its sanitizers run with."""
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "a.c").write_text("int main(void) { return 0; }\n", encoding="utf-8")
        call = [compiler(cc), *SANITIZED, "-o", "a", "a.c"]
        linked = subprocess.run(call, cwd=folder, capture_output=True, check=False).returncode == 0
        if not linked or subprocess.run([Path(folder) / "a"], check=False).returncode:
            pytest.skip(f"{cc} has no sanitizers here: the generated C was NOT run with them")


def run_two(cc, sampled, name, dtype, inputs, **made):
    """Run two instances with sanitizers; return what each wrote, and how many were left out."""
    sanitizers(cc)
    with built(cc, sampled, name, dtype, TWO, *SANITIZED, **made) as program:
        done = subprocess.run([program], input=np.ascontiguousarray(inputs).tobytes(),
                              capture_output=True, check=False)  # fmt: skip
    assert done.returncode == 0, done.stderr.decode()
    found = np.array(done.stdout.split(), dtype=float).reshape(-1, 2, 2)
    return found[..., 0].T, found[..., 1].T


def run_c(sampled, name, r, y, applied, start=None, dtype="double", **made):
    """Return u, what the limits inside make of it, and d_hat, for given r, y and applied u."""
    pointer = ctypes.POINTER(ctypes.c_double)
    given = [np.ascontiguousarray(v, dtype=float) for v in (r, y, applied)]
    found = [np.zeros(len(r)) for _ in range(3)]
    with built("cc", sampled, name, dtype, HARNESS, "-shared", "-fPIC", **made) as library:
        ctypes.CDLL(str(library)).run(
            ctypes.c_int(len(r)), *(v.ctypes.data_as(pointer) for v in given),
            ctypes.c_int(start is not None), ctypes.c_double(start or 0.0),
            *(v.ctypes.data_as(pointer) for v in found),
        )  # fmt: skip
    return found


@contextlib.contextmanager
def c_controller(sampled, name, **made):
    """Give the compiled controller, at rest, with output(r, y) and update(applied)."""
    with built("cc", sampled, name, "double", STEPWISE, "-shared", "-fPIC", **made) as library:
        found = ctypes.CDLL(str(library))
        found.output.restype = ctypes.c_double
        found.output.argtypes = [ctypes.c_double, ctypes.c_double]
        found.update.argtypes = [ctypes.c_double]
        found.begin()
        yield found


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
