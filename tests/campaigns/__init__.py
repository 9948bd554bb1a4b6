"""Long comparisons with brute force, run by hand: ``python -m tests.campaigns.designs``."""
