"""Oracles: short, slow, each with a method of its own, and nothing taken from the package.

They take the blocks as plain coefficients. What each gives is compared with closed forms in
test_oracles.py; the numbers of the package are compared with them in test_sample.py and in
`tests.campaigns.oracles`. The other campaigns use them, too.
"""
