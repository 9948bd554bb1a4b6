"""The way from a submission to its points: give out the problem sets, grade, report.

python -m nrdob_course.grading release
python -m nrdob_course.grading grade FOLDER
python -m nrdob_course.grading report
"""

__all__: list[str] = []
