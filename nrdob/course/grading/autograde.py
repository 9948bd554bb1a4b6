"""Grade one submission with nbgrader, in a process of its own.

    python -m nrdob.course.grading.autograde COURSE STUDENT SET

COURSE is a folder in nbgrader's layout that this process has for itself. What came out is written
to ``COURSE/result.json``; the marked notebook and the feedback lie where nbgrader puts them.
"""

from __future__ import annotations

import json
import os
import sys
import warnings
from pathlib import Path
from typing import Any

from nbclient.exceptions import DeadKernelError
from nbformat.v4 import new_output
from nbgrader.apps.api import NbGraderAPI
from nbgrader.preprocessors import CheckCellMetadata, Execute, LimitOutput, SaveAutoGrades
from nbgrader.utils import is_grade, is_solution, temp_attrs
from traitlets.config import Config
from traitlets.config.loader import PyFileConfigLoader

from .feedback import offline

__all__ = ["SETTINGS", "course", "keep_points", "write_feedback"]

# What nbgrader does with its own database is not for those who grade.
warnings.filterwarnings("ignore", module="nbgrader")

SETTINGS = "nbgrader_config.py"

NOT_MARKED = "Not marked yet: its points are still to come."

PRELUDE = """
def _prepare():
    import builtins, sys

    def leave(*code):
        raise SystemExit(*code)

    # IPython's own would end the kernel a moment after the cell is done, and nobody knew why.
    get_ipython().user_ns.update(exit=leave, quit=leave)
    builtins.exit = builtins.quit = leave
    try:
        import resource
    except ImportError:  # Windows
        return
    for limit, most in [(resource.RLIMIT_AS, 4 << 30), (resource.RLIMIT_FSIZE, 200 << 20)]:
        try:
            resource.setrlimit(limit, (most, resource.getrlimit(limit)[1]))
        except (ValueError, OSError):
            pass


_prepare()
del _prepare
# On a busy machine this takes long, and the time is not the student's.
import matplotlib.pyplot
import nrdob.course.exercises
del matplotlib, nrdob
"""


def course(root: Path) -> NbGraderAPI:
    """Give nbgrader's programming interface for the course in a folder."""
    programs = str(Path(sys.executable).parent)  # nbgrader calls one that is installed beside it
    if programs not in os.environ["PATH"].split(os.pathsep):
        os.environ["PATH"] = programs + os.pathsep + os.environ["PATH"]
    config = Config(PyFileConfigLoader(SETTINGS, str(root)).load_config())
    config.CourseDirectory.root = str(root.resolve())
    config.Autograde.autograde_preprocessors = [
        PatientExecute,
        LimitOutput,
        SaveAutoGrades,
        CheckCellMetadata,
    ]
    return NbGraderAPI(config=config)


REMARKS: list[str] = []
"""What happened while the cells ran; this process runs one notebook."""


class PatientExecute(Execute):  # type: ignore[misc]
    """Run the cells as nbgrader does, and survive those that end the kernel or flood it.

    A cell that ends its kernel, or that cannot be interrupted, is left out, with an error in its
    place, and the notebook run again. So each such cell costs its own problem only.
    """

    most_output = 200_000  # bytes of one cell
    most_deaths = 10

    def preprocess(self, nb: Any, resources: Any = None, km: Any = None) -> tuple[Any, Any]:
        """Execute the notebook, and again without a cell that ends the kernel."""
        self.left_out: dict[int, str] = {}
        while True:
            self.at = -1
            try:
                nb, resources = super().preprocess(nb, resources, km)
                break
            except (DeadKernelError, TimeoutError) as error:
                if self.at < 0 or len(self.left_out) == self.most_deaths:
                    raise
                dead = isinstance(error, DeadKernelError)
                why = "it ended the kernel" if dead else "it could not be stopped"
                self.left_out[self.at] = why
                REMARKS.append(f"{name_of(nb.cells[self.at])} was left out: {why}")
        for cell in nb.cells:
            if cell.cell_type == "code" and is_grade(cell) and not is_solution(cell):
                keep_points(cell)
        return nb, resources

    def preprocess_cell(self, cell: Any, resources: Any, index: int) -> tuple[Any, Any]:
        """Execute one cell; the first is ours and may take longer."""
        if index == 0:
            with temp_attrs(self, timeout=120):
                self.wait_for_reply(self.kc.execute(PRELUDE, silent=True, store_history=False))
        self.at, self.size = index, 0
        if index in self.left_out:
            cell.outputs = [failure("CellLeftOut", self.left_out[index])]
            return cell, resources
        cell, resources = super().preprocess_cell(cell, resources, index)
        if any(out.get("ename") == "CellTimeoutError" for out in cell.get("outputs", [])):
            REMARKS.append(f"{name_of(cell)} was stopped after {self.timeout} s")
        return cell, resources

    def output(self, outs: list[Any], msg: Any, display_id: Any, cell_index: int) -> Any:
        """Keep an output, unless the cell has said enough; points and errors are always kept."""
        content = msg["content"]
        self.size += len(content.get("text", ""))
        if msg["msg_type"] == "stream" and self.size > self.most_output:
            return None
        return super().output(outs, msg, display_id, cell_index)


def name_of(cell: Any) -> str:
    """Give the name of a cell, as the person who marks knows it."""
    return str(cell.metadata.get("nbgrader", {}).get("grade_id") or cell.get("id", "a cell"))


def failure(name: str, text: str) -> Any:
    """Make the output of a cell that failed."""
    return new_output("error", ename=name, evalue=text, traceback=[f"{name}: {text}"])


def keep_points(cell: Any) -> None:
    """Leave in a test cell what nbgrader reads as points, or an error if it gave none.

    nbgrader takes the first result, whatever it is, and gives full points if there is none; text
    on stderr, a mere warning, costs all of them.
    """
    for out in cell.outputs:
        if out.output_type == "error":  # its lines would show the hidden tests
            out.traceback = [f"{out.ename}: {out.evalue}"]
    if any(out.output_type == "error" for out in cell.outputs):
        return
    most = float(cell.metadata.nbgrader["points"])
    points = [out for out in cell.outputs if out.output_type == "execute_result" and _is(out, most)]
    if not points:
        cell.outputs.append(failure("NoPoints", "the test did not come to its end"))
        return
    shown = [out for out in cell.outputs if out.output_type == "display_data"]
    cell.outputs = [*shown, points[-1]]


def _is(output: Any, most: float) -> bool:
    try:
        return 0 <= float(output.data["text/plain"]) <= most
    except (KeyError, ValueError):
        return False


def grade(root: Path, student: str, set_name: str) -> dict[str, Any]:
    """Grade a submission, and make its feedback."""
    api = course(root)
    done = api.autograde(set_name, student)
    if not done["success"]:
        return {"error": done["log"]}
    with api.gradebook as gradebook:
        notebook = gradebook.find_submission_notebook(set_name, set_name, student)
        grades = {grade.name: grade.auto_score for grade in notebook.grades}
        comments = {comment.name: comment.auto_comment for comment in notebook.comments}
    write_feedback(api, student, set_name)
    remarks = list(dict.fromkeys(REMARKS))
    return {"grades": grades, "comments": comments, "remarks": remarks}


def write_feedback(api: NbGraderAPI, student: str, set_name: str) -> None:
    """Let nbgrader write the feedback, and make it readable without a network."""
    with api.gradebook as gradebook:
        for grade in gradebook.find_submission_notebook(set_name, set_name, student).grades:
            if grade.auto_score is not None:
                continue
            comment = gradebook.find_comment(grade.name, set_name, set_name, student)
            comment.auto_comment = NOT_MARKED if grade.manual_score is None else None
        gradebook.db.commit()
    done = api.generate_feedback(set_name, student)
    if not done["success"]:
        raise RuntimeError(done["log"])
    page = Path(api.coursedir.root) / "feedback" / student / set_name / f"{set_name}.html"
    page.write_text(offline(page.read_text("utf-8")), "utf-8")


def main(arguments: list[str]) -> int:
    """Run the command line; the result is the exit code."""
    root, student, set_name = Path(arguments[0]), arguments[1], arguments[2]
    result = grade(root, student, set_name)
    (root / "result.json").write_text(json.dumps(result), "utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
