"""Settings of nbgrader for the problem sets; `make release` and `make grade` use them, too.

To work with nbgrader itself (formgrader, JupyterHub), start it in this folder.
"""

from nbconvert.preprocessors import CSSHTMLHeaderPreprocessor
from nbgrader.preprocessors import ClearHiddenTests, GetGrades

from nrdob_course import exercises

c = get_config()  # noqa: F821  (nbgrader provides it)

c.CourseDirectory.course_id = "nrdob"

# What `check` tells students is what a cell may take: an endless loop costs this many seconds, and
# the points of its own problem.
c.Execute.timeout = int(getattr(exercises, "BUDGET", 20))
c.Execute.interrupt_on_timeout = True
# Much output needs a while to arrive; a cell that cannot be interrupted costs this time, too.
c.Execute.iopub_timeout = 20
c.LimitOutput.max_lines = 200
# A picture that lies beside the notebook, a photo of a page, becomes part of the feedback.
c.HTMLExporter.embed_images = True
# Feedback shows what the hidden tests found, not the tests: they serve the next course, too.
c.GenerateFeedback.preprocessors = [ClearHiddenTests, GetGrades, CSSHTMLHeaderPreprocessor]
# What stands where an answer is to be written; a value has its own placeholder, x = ...
c.ClearSolutions.code_stub = {"python": "# YOUR CODE HERE"}
