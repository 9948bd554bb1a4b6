"""Section V and the references."""

import re
from itertools import product

import numpy as np

from nrdob import NRDOB, LowPassFilter, interpolating_filter
from nrdob.analysis import judge
from nrdob.numerics import QuasiPolynomial, number
from nrdob.paper import example

from .ledger import Finding, counted, every
from .recurring import both, section
from .signals import is_stable, turned

__all__ = ["REFERENCE_2", "SECTION"]

SECTION = section("conclusions")


@SECTION.check("concl.unstable_nmp_delay")
def _designs_exist() -> Finding:
    second, third, fourth = (both(k) for k in (2, 3, 4))
    features = [loop.G.to_tf().zeros().real.max() > 0 for loop in second]
    features += [loop.G.to_tf().poles().real.max() > 0 for loop in third]
    features += [loop.delay > 0 for loop in fourth]
    stable = [*map(is_stable, second + third + fourth)]
    return Finding(
        every(features) and every(stable),
        f"{counted(stable)} loops stable: Examples 2 (zero in the right half "
        "plane), 3 (pole there), 4 (dead time), each with its plant and its modified plant",
    )


@SECTION.check("concl.not_matching")
def _not_matching() -> Finding:
    filters = [LowPassFilter(lam, n) for n in (2, 3, 4) for lam in (0.01, 0.1, 1.0)]
    plants = [example(which).process for which in (2, 3)]
    matched = [NRDOB(plant, plant, 0.1, F) for plant, F in product(plants, filters)]
    D, delay = [1.0, 4.0, 4.0], example(4).delay  # and the numerators of Example 4 are 1
    delayed = [
        (QuasiPolynomial(np.polymul(D, each.den), np.polysub(Dm, D), delay), each)
        for Dm, each in product((D, [1.0, 4.0, 3.75]), filters)
    ]
    late = [judge("", [QuasiPolynomial(each.den)], p).stable for p, each in delayed]
    tried = product(plants, (0.01, 0.1, 1.0))
    made = [NRDOB(plant, plant, 0.1, interpolating_filter(plant, lam)) for plant, lam in tried]
    as_one = [loop.stability().observer_loop.stable is True for loop in made]
    lost = [_lost_to_a_wrong_delay(times * 0.001) for times in (3.0, 3.1)]
    words = ["unstable" if each else "stable" for each in lost]
    own = delayed[: len(filters)]
    own_factors = all(p.delay == 0 and np.allclose(p.q, np.polymul(D, F.den)) for p, F in own)
    fails = [loop.stability().observer_loop.stable is False for loop in matched]
    works = [verdict is True for verdict in late]
    return Finding(
        every(fails) and not any(works),
        f"matched Examples 2 and 3: unstable in {counted(fails)} loops; Example 4 with "
        f"the path Fu delayed: stable in {counted(works)}, and with n = 3, λ = 0.001 s, "
        f"θ = 0.05 s {words[0]} with 3.0 ms more dead time, {words[1]} with 3.1 ms; "
        f"matched with filters made for the model: stable in {counted(as_one)}",
        conditions={
            "the matched model never works in Examples 2 and 3": every(fails),
            "dead time can be matched with the path Fu delayed": every(works),
            "the characteristic function is then N·D·Df": own_factors,
            "an error of θ below c₃λ does no harm, one above loses the loop": lost == [False, True],
            "a filter made for the model makes the matched model work": all(as_one),
        },
    )


def _lost_to_a_wrong_delay(error: float) -> bool:
    """Whether 1 + F (exp(−(θ + error)s) − exp(−θs)), n = 3, turns around 0, for λ and θ below."""
    s = 1j * np.linspace(0, 2e4, 200_001)  # far enough for λ = 0.001 s, dense enough for θ = 0.05 s
    values = 1 + LowPassFilter(0.001, 3)(s) * (np.exp(-(0.05 + error) * s) - np.exp(-0.05 * s))
    return abs(turned(values)) > 0.25


REFERENCE_2 = (
    "IEEE/ASME Transactions on Mechatronics, 9 (4), pp. 706-710 [10.1109/TMECH.2004.839034], 2006"
)
"""Journal, volume, pages, DOI and year of reference [2], as the paper gives them."""


@SECTION.check("ref02.year")
def _year() -> Finding:
    found = re.search(r", (\d+) \(\d+\).*\.(\d{4})\.\d+\], (\d{4})$", REFERENCE_2)
    if not found:
        return Finding(False, "the reference cannot be read")
    volume, by_doi, printed = map(int, found.groups())
    by_volume = 1996 + volume - 1
    return Finding(
        printed == by_doi,
        f"{number(by_doi, 4)} by the DOI 10.1109/TMECH.2004.839034, {number(by_volume, 4)} by the "
        "volume",
        conditions={"the DOI says 2004": by_doi == 2004, "the volume says 2004": by_volume == 2004},
    )
