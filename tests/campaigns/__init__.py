"""Long runs against oracles, `python -m tests.campaigns.<name>`; the tests run a small sample."""
