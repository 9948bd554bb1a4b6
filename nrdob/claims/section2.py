"""Sections I and II: the loop, its filter, and what it does at low and at high frequency."""

from .ledger import Section

SECTION = Section()
