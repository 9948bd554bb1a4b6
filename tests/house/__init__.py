"""The house keeps itself in order: what `make lint` asks of rooms, docstrings and pages.

python -m tests.house        every fault with its place; fails if there is one
python -m tests.house.map    the rooms floor by floor
"""
