"""What holds around a student's code, and what is remarked of it before it runs."""

from __future__ import annotations

import json
import os
import platform
import socket
import subprocess
import sys
import tempfile
from pathlib import Path

import nbformat
import pytest

import nrdob
from attacks import ESCAPES, PRELUDE
from handin import FORGERIES, NAME, handed
from nrdob_course.grading import autograde, disk, sandbox, seccomp
from nrdob_course.grading import command as exercises
from nrdob_course.grading.remarks import suspicious
from problemsets import SETS

sandboxed = pytest.mark.skipif(bool(sandbox.missing()), reason="there is no sandbox on this system")
pytestmark = pytest.mark.filterwarnings("ignore:Object of type")


REFUSED = [
    "open(secret).read()",
    "open(secret, 'w')",
    "open(secret, 'a')",
    "os.truncate(secret, 0)",
    "os.remove(secret)",
    "os.rename(secret, workdir / 'x')",
    "os.link(secret, workdir / 'x')",
    "os.listdir(secret.parent)",
    "(secret.parent / 'new').mkdir()",
    "os.listdir('/proc')",
    "open(f'/proc/{os.getppid()}/environ').read()",
    "os.listdir(f'/proc/{os.getppid()}/cwd')",
    "open('/etc/passwd').read()",
    "os.listdir(Path.home())",
    "os.symlink(secret, 'link') or open('link').read()",
    "subprocess.run(['/bin/sh', '-c', 'cat /etc/passwd'], check=True)",
]
NETWORK = [
    "socket.create_connection(('127.0.0.1', 9), timeout=1)",
    "socket.socket().bind(('127.0.0.1', 0))",
]
SIGNALS = ["os.kill(os.getppid(), 0)"]
ALLOWED = [
    "Path('page.txt').write_text('x')",
    "os.mkdir('folder')",
    "os.rename('page.txt', 'folder/page.txt')",
    "plt.plot([1, 2])[0].figure.savefig('figure.png')",
    "__import__('sympy').Symbol('x')",
    "__import__('pdb')",
    "__import__('nrdob.reporting')",
    "[thread.start() or thread.join() for thread in [__import__('threading').Thread()]]",
    "socket.socketpair()",
    "resource.getrlimit(resource.RLIMIT_AS)",
    "signal.raise_signal(signal.SIGCONT)",
]
if platform.machine() != "x86_64":
    ESCAPES = {name: attempt for name, attempt in ESCAPES.items() if "call(" not in attempt}


@pytest.fixture(scope="module")
def behind(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """What becomes of each attempt in a sandbox; nothing has changed outside of it."""
    place = tmp_path_factory.mktemp("place")
    secret, workdir = place / "gradebook.db", place / "workdir"
    secret.write_text("points", "utf-8")
    workdir.mkdir()
    course = Path(sandbox.__file__).parents[1]
    listener = socket.create_server(("127.0.0.1", 0))
    datagrams = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    datagrams.bind(str(place / "socket"))
    program = f"""{PRELUDE}
from pathlib import Path
import matplotlib
matplotlib.use("Agg")
import matplotlib.pyplot as plt
from nrdob_course.grading import sandbox
workdir, secret = Path({str(workdir)!r}), Path({str(secret)!r})
datagrams = {str(place / "socket")!r}
course, project = Path({str(course)!r}), Path({str(course.parents[1])!r})
port = {listener.getsockname()[1]}
os.chdir(workdir)
sandbox.limit()
sandbox.build(workdir, [])
sandbox.seal()
found = {{}}
for attempt in {[*REFUSED, *NETWORK, *SIGNALS, *ALLOWED, *ESCAPES.values()]!r}:
    try:
        eval(attempt)
        found[attempt] = "done"
    except (OSError, ValueError, MemoryError, ArithmeticError, LookupError) as error:
        found[attempt] = "refused"
print(json.dumps(found))
"""
    with listener, datagrams:
        done = subprocess.run(
            [sys.executable, "-c", program], capture_output=True, encoding="utf-8", check=False
        )
        assert done.returncode == 0, done.stderr
        datagrams.setblocking(False)
        with pytest.raises(BlockingIOError):
            datagrams.recv(1)
    assert secret.read_text("utf-8") == "points"
    assert sorted(path.name for path in place.iterdir()) == ["gradebook.db", "socket", "workdir"]
    return dict(json.loads(done.stdout.splitlines()[-1]))


@pytest.mark.skipif(os.name != "posix", reason="needs folders that are opened")
def test_what_lies_too_deep_counts_as_too_much() -> None:
    with disk.workdir() as workdir:
        folder = os.open(workdir, os.O_RDONLY)
        for _ in range(17):  # the path gets longer than Linux takes
            os.mkdir("x" * 255, dir_fd=folder)
            inner = os.open("x" * 255, os.O_RDONLY, dir_fd=folder)
            os.close(folder)
            folder = inner
        os.close(folder)
        assert disk.used(workdir, None)[0] > disk.MOST_FILES
    assert not workdir.exists()


@pytest.mark.skipif(os.name != "posix" or sandbox.is_root(), reason="nothing is locked for root")
def test_what_is_locked_counts_as_too_much(tmp_path: Path) -> None:
    (tmp_path / "locked").mkdir(mode=0o300)
    try:
        assert disk.used(tmp_path, None)[0] > disk.MOST_FILES
    finally:
        (tmp_path / "locked").chmod(0o700)


@sandboxed
@pytest.mark.parametrize("name", ESCAPES)
def test_no_attempt_to_get_out_succeeds(name: str, behind: dict[str, str]) -> None:
    assert behind[ESCAPES[name]] == "refused"


@pytest.mark.parametrize("machine", seccomp.ARCHITECTURES)
def test_every_jump_of_the_filter_stays_in_it(machine: str) -> None:
    steps = seccomp.program(machine, 1000)
    assert len(steps) < 4096
    for place, (code, so, not_so, _) in enumerate(steps):
        if code & 7 == 5:  # a jump
            assert place + 1 + max(so, not_so) < len(steps)
    assert steps[-1] == (seccomp.RETURN, 0, 0, seccomp.ALLOW)


@pytest.mark.skipif(not seccomp.available(), reason="needs Linux on x86_64 or aarch64")
def test_the_filter_knows_the_numbers_of_this_system() -> None:
    names = {"x86_64": "x86_64-linux-gnu/asm/unistd_64.h", "aarch64": "asm-generic/unistd.h"}
    header = Path("/usr/include") / names[platform.machine()]
    if not header.exists():
        pytest.skip("needs the headers of Linux")
    text = header.read_text("utf-8")
    column = list(seccomp.ARCHITECTURES).index(platform.machine())
    for row in f"{seccomp.REFUSED}, {seccomp.OWN}, {seccomp.IGNORED}".split(","):
        name, *numbers = row.split()
        if f"__NR_{name} " in text and numbers[column] != "-":
            assert f"__NR_{name} {numbers[column]}\n" in text


@sandboxed
@pytest.mark.parametrize("below", ["python3", "opt/python3.11/teacher", "usr/local/lib/course"])
def test_a_project_anywhere_stays_closed(
    below: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    project = tmp_path / below / "project"
    for name in (
        "book/nrdob_course/grading",
        "nrdob",
        "notebooks",
        "lib/site-packages/numpy",
    ):
        (project / name).mkdir(parents=True)
    monkeypatch.setattr(sandbox, "COURSE", project / "book" / "nrdob_course")
    monkeypatch.setattr(sandbox, "PACKAGE", project / "nrdob")
    packages = str(project / "lib" / "site-packages")
    monkeypatch.setattr(sys, "path", [str(project), str(project.parent), packages, *sys.path])
    # A library that was loaded from a folder above all this opens none of it.
    monkeypatch.setattr(sandbox, "shared_libraries", lambda: {tmp_path})
    found = sandbox.readable()
    inside = {path.relative_to(project) for path in found if path.is_relative_to(project)}
    assert inside == {Path("nrdob"), Path("lib/site-packages")}
    assert not any(project.is_relative_to(path) for path in found)


@pytest.mark.slow
@sandboxed
@pytest.mark.parametrize("attempt", REFUSED)
def test_nothing_of_others_can_be_read_or_written(attempt: str, behind: dict[str, str]) -> None:
    assert behind[attempt] == "refused"


@sandboxed
@pytest.mark.parametrize("attempt", ALLOWED)
def test_its_own_folder_and_the_libraries_are_there(attempt: str, behind: dict[str, str]) -> None:
    assert behind[attempt] == "done"


@sandboxed
@pytest.mark.skipif(sandbox.generation() < 4, reason="needs Linux 6.7")
@pytest.mark.parametrize("attempt", NETWORK)
def test_nothing_can_be_sent_or_served(attempt: str, behind: dict[str, str]) -> None:
    assert behind[attempt] == "refused"


@sandboxed
@pytest.mark.skipif(sandbox.generation() < 6, reason="needs Linux 6.12")
def test_no_other_process_can_be_ended(behind: dict[str, str]) -> None:
    assert behind[SIGNALS[0]] == "refused"


# --- root becomes nobody ------------------------------------------------------------------------

OPEN = Path("/usr/bin/python3")
"""A Python that everybody can read; that of these tests may lie in somebody's home."""

AS_NOBODY = [
    "open(secret, 'a')",
    "open(secret.parent / 'solutions.ipynb').read()",
    "os.truncate(secret, 0)",
    "os.remove(secret)",
    "os.rename(secret, workdir / 'x')",
    "(secret.parent / 'new').mkdir()",
    "os.chmod(secret, 0o777)",
    "os.chown(secret, 65534, 65534)",
    "os.setuid(0)",
    "os.setgid(0)",
    "os.kill(os.getppid(), 9)",
    "open(f'/proc/{os.getppid()}/environ').read()",
    "open(f'/proc/{os.getppid()}/mem', 'r+b')",
    "os.listdir(f'/proc/{os.getppid()}/cwd')",
    "open('/etc/shadow').read()",
]


@pytest.mark.skipif(sys.platform != "linux" or os.getuid() != 0, reason="needs root, on Linux")
@pytest.mark.skipif(not OPEN.exists(), reason="needs a Python that everybody can read")
@pytest.mark.parametrize("with_wall", [pytest.param(True, marks=sandboxed), False])
def test_who_grades_as_root_gives_students_code_the_rights_of_nobody(with_wall: bool) -> None:
    # Not below the folder of the tests, which is closed to others as it is.
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        place.chmod(0o755)
        secret, solutions, workdir = (
            place / name for name in ("gradebook.db", "solutions.ipynb", "workdir")
        )
        for path in (secret, solutions):
            path.write_text("points", "utf-8")
        solutions.chmod(0o600)  # as a teacher's folder is closed
        workdir.mkdir()
        (workdir / "page.png").write_text("x", "utf-8")
        program = f"""
import json, os, sys, types
from pathlib import Path
package = types.ModuleType("grading")
package.__path__ = [{str(Path(sandbox.__file__).parent)!r}]
sys.modules["grading"] = package
sys.modules["nrdob"] = types.ModuleType("nrdob")
sys.modules["nrdob"].__file__ = {nrdob.__file__!r}
from grading import sandbox
workdir, secret = Path({str(workdir)!r}), Path({str(secret)!r})
os.chdir(workdir)
if not {with_wall}:
    sandbox.generation = lambda: 0
assert not sandbox.stays_root(), sandbox.stays_root()
sandbox.build(workdir, [])
found = {{"ids": [*os.getresuid(), *os.getresgid(), *os.getgroups()]}}
for attempt in {AS_NOBODY!r}:
    try:
        eval(attempt)
        found[attempt] = "done"
    except OSError as error:
        found[attempt] = "refused"
Path("page.png").write_text("y")
os.rename("page.png", "new.png")
print(json.dumps(found))
"""
        command = [OPEN, "-I", "-c", program]
        done = subprocess.run(command, capture_output=True, encoding="utf-8", check=False)
        assert done.returncode == 0, done.stderr
        found = json.loads(done.stdout)
        assert found.pop("ids") == [65534] * 6
        assert found == dict.fromkeys(AS_NOBODY, "refused")
        assert secret.read_text("utf-8") == "points"


def test_root_grades_only_if_asked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sandbox, "is_root", lambda: True)
    assert exercises.main(["grade", str(tmp_path)]) == 2
    assert "--as-root" in capsys.readouterr().err
    monkeypatch.setattr(sandbox, "stays_root", lambda: "")
    assert exercises.main(["grade", str(tmp_path), "--as-root"]) == 2
    assert "no submissions" in capsys.readouterr().err


@pytest.mark.skipif(sys.platform == "win32", reason="there is no root on Windows")
def test_who_stays_root_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(os, "geteuid", lambda: 0, raising=False)
    monkeypatch.setattr(os, "name", "posix")
    monkeypatch.setattr(sandbox, "PACKAGE", tmp_path)  # which is closed to others
    assert "students' code would be" in sandbox.stays_root()
    with pytest.raises(exercises.CourseError, match="no submissions"):
        exercises.grade(tmp_path, target=tmp_path / "out")
    assert "you are root" in capsys.readouterr().out


@pytest.mark.thorough
@pytest.mark.skipif(sys.platform != "linux", reason="only Linux gives orphans to a grandparent")
def test_what_is_left_running_can_be_ended() -> None:
    program = """
import os, time
import psutil
from nrdob_course.grading import sandbox
from nrdob_course.grading.children import end
sandbox.adopt_orphans()
if not os.fork():
    if not os.fork():
        os.setsid()
        time.sleep(600)
    os._exit(0)
os.wait()
left = psutil.Process().children(recursive=True)
end(os.getpid(), itself=False)
print(len(left), left[0].wait(60) is not None or not left[0].is_running())
"""
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, encoding="utf-8", check=True
    )
    assert done.stdout.split() == ["1", "True"]


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux limits the memory of a process")
def test_a_page_that_takes_too_much_memory_is_given_up(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(autograde, "ready", lambda: None)
    monkeypatch.setattr(autograde, "grade", lambda *any: {"page": len(bytearray(3 << 30))})
    assert autograde.run(str(tmp_path), "anna", NAME) == 1
    assert not (tmp_path / "result.json").exists()


# --- what is read -------------------------------------------------------------------------------


def code(source: str) -> list[nbformat.NotebookNode]:
    return [nbformat.v4.new_code_cell(source, id="answer")]


@pytest.mark.parametrize(
    ("source", "sign"),
    [
        ("from nrdob_course.exercises.set2 import _good", "import _good"),
        ("import nrdob_course.exercises.set2 as s", "import nrdob_course.exercises.set2"),
        ("nrdob_course.exercises.score = 1", "nrdob_course.exercises.score"),
        ("nrdob.NRDOB.stability = 1", "nrdob.NRDOB.stability = …"),
        ("case._loop.margins()", "case._loop"),
        ("open('x')", "open"),
        ("x = __builtins__", "__builtins__"),
        ("import ctypes", "import ctypes"),
        ("from subprocess import run", "from subprocess import run"),
        ("a = '/proc/1/cwd'", "'/proc/1/cwd'"),
        ("import os\nos.system('ls')", "os.system"),
        ("from nrdob_course import claims", "from nrdob_course import claims"),
        ("import nrdob_course as n\nn.exercises.set1.settled_table(case)", "import nrdob_course"),
        ("getattr(case, '_p' + '_B')(case)", "getattr"),
        ("from functools import reduce\nreduce(getattr, names, case)", "getattr"),
        ("np.ctypeslib.ctypes.CDLL(None).system", "np.ctypeslib"),
        ("np.fromfile('x')", "np.fromfile"),
        ("np.savetxt('x', y)", "np.savetxt"),
        ("np.load('x', allow_pickle=True)", "np.load"),
        ("from numpy import load as weight", "from numpy import load"),
        ("import pty, resource, runpy, mmap, asyncio", "import pty, import resource"),
        ("import codecs\ncodecs.open('x')", "import codecs"),
        ("import linecache", "import linecache"),
        ("from numpy import *", "from numpy import *"),
        ("import sys", "import sys"),
        ("sympy.sympify('1')", "sympy.sympify"),
        ("match case:\n    case object(__class__=found):\n        pass", "__class__"),
        ("'{0.__class__}'.format(case)", "__class__"),
        ("from . import grading", "from . import grading"),
        ("f.__globals__", "f.__globals__"),
        ("!cat x", "the command !"),
        ("%%bash\ncat x", "the command %%bash"),
        *((forgery, "") for forgery in FORGERIES if "json" not in forgery),
    ],
)
def test_what_no_answer_needs_is_remarked(source: str, sign: str) -> None:
    [remark] = suspicious(code(source), [])
    assert remark.startswith("answer does what no answer needs: ")
    assert sign in remark


@pytest.mark.parametrize(
    "source",
    [
        "import numpy as np\nimport control as ct\nx = np.array([1]).real",
        "import scipy.optimize as so\nfrom scipy.signal import lti\nimport math, re, json",
        "getattr(case, 'G', 1)\nnp.random.default_rng(1)\nnp.testing.assert_allclose(1, 1)",
        "class Lag:\n    def __init__(self):\n        self.T = 1",
        "def f(case):\n    return case.poles[-1] - 2j",
        "loop = nrdob.NRDOB(1, 1, 1, 1)\nloop.stability()",
        "not python at all (",
    ],
)
def test_what_answers_need_is_not_remarked(source: str) -> None:
    assert suspicious(code(source), []) == []


@pytest.mark.parametrize("path", SETS, ids=lambda path: path.stem)
def test_no_published_solution_is_remarked(path: Path) -> None:
    solved = nbformat.read(path, as_version=4)
    for cell in solved.cells:
        cell.source = cell.source.split("### BEGIN HIDDEN TESTS")[0]
    given_out = [cell for cell in solved.cells if "SOLUTION" not in cell.source]
    assert suspicious(solved.cells, given_out) == []


@pytest.mark.thorough
def test_without_a_wall_what_is_suspicious_is_not_run(
    released: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    notebook = handed(released)
    notebook.cells.append(nbformat.v4.new_code_cell("open('/etc/passwd')", id="own"))
    (tmp_path / "in" / "spy").mkdir(parents=True)
    nbformat.write(notebook, tmp_path / "in" / "spy" / f"{NAME}.ipynb")
    monkeypatch.setattr(sandbox, "missing", lambda: "there is no sandbox")
    assert exercises.grade(tmp_path / "in", target=tmp_path / "out") == 1
    said = capsys.readouterr().out
    assert "there is no sandbox. It runs with your rights" in said
    assert "NOT GRADED: it was not run" in said and "'/etc/passwd'" in said
    assert os.listdir(tmp_path / "out" / "submitted" / "spy") != []
