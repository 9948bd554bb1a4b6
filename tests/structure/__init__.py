"""Rules of the package that `make lint` checks: public APIs, callers, docstrings, pages.

python -m tests.structure        every fault with its place; fails if there is one
python -m tests.structure.map    the layers of the package, each module with its lines
"""
