"""The argument principle, drawn: the pictures say the turns that the zeros and poles make."""

from xml.etree import ElementTree

import matplotlib as mpl
import pytest

from nrdob.plotting import winding_animation, winding_plot

mpl.use("Agg")
CASES = [
    ([-0.5, 0.5j, 1.5 + 1j], [0.3 + 0.2j], 1),
    ([2.0], [0.1j], -1),
    ([0.5, -0.5j], [], 2),
]


@pytest.mark.slow
@pytest.mark.parametrize(("zeros", "poles", "turns"), CASES)
def test_the_walk_ends_with_zeros_less_poles_inside(zeros, poles, turns):
    drawn = winding_plot(zeros, poles)
    assert drawn.alt.endswith(f", {turns:.2f} clockwise turns around 0")
    assert len(drawn.axes.flat) == 8


@pytest.mark.slow
@pytest.mark.parametrize(("zeros", "poles", "turns"), CASES)
def test_the_animation_is_well_formed_and_can_rest(zeros, poles, turns):
    moving = winding_animation(zeros, poles)
    data, metadata = moving._repr_mimebundle_()
    root = ElementTree.fromstring(data["image/svg+xml"])
    kinds = {each.get("class") for each in root}
    assert {"moving", "rest"} <= kinds and "prefers-reduced-motion" in data["image/svg+xml"]
    resting = next(each for each in root if each.get("class") == "rest")
    assert not [each for each in resting.iter() if each.tag.endswith("animate")]
    assert f"{turns} clockwise" in metadata["image/png"]["alt"]
