"""An NR-DOB loop, with its verdict, margins, responses and plots."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import TYPE_CHECKING, Any

from numpy.typing import ArrayLike

from . import analysis
from .analysis import LoopMargins, Stability, loop_margins, stability
from .diagram import CLOSED_LOOP, MAPS, LoopEquations, Quotient
from .digital import SampledLoop

if TYPE_CHECKING:
    from .plotting import Figure

__all__ = ["NRDOB"]


class NRDOB(LoopEquations):
    r"""A control loop with a noise-reduction disturbance observer, Fig. 1 of the paper.

    The maps of eqs. (3), (4) and (7) are attributes, callable at complex s: `T_R`, `S_d`,
    `S_delta`, `S_eta`, `E_R`, `U_R`, `U_d`, `U_delta`, `U_eta`; so are the open loops `CGm`,
    `FH`, `L`, the mismatch `H` and `ratio`, and all the feedback `K`. Each can say how much white
    noise it passes, as `loop.S_eta.noise_power()`. `fractions` holds numerator and denominator of
    the four blocks, as `loop.fractions.Gm.den`. `nrdob.diagram.equations` draws the diagram.

    Parameters
    ----------
    process, model : control.TransferFunction, StateSpace, DelayedTransferFunction or (num, den)
        The plant G and the process model G̃, proper, with or without dead time. The inverse leaves
        that of the model out, and u is delayed by it, see `nrdob.diagram.equations`.
    controller : control.TransferFunction, StateSpace, number or (num, den)
        The feedback controller C, proper.
    filter : LowPassFilter, or a stable proper block with F(0) = 1
        The noise filter F, of at least the model's relative degree.
    keep_factors : bool
        By default the blocks F/G̃ and (1 - F)G̃ are each built as one, without what they share with
        themselves: zeros of the model that F has, too, and poles of the model at which F = 1.
        True keeps these, as a diagram does whose blocks are 1 - F, G̃ and its inverse.

    Raises
    ------
    TypeError, ValueError
        If a block cannot stand where it is put; the message names the block and the remedy.

    Examples
    --------
    Example 3 of the paper, an unstable plant under a stable model of opposite sign:

    >>> import control as ct
    >>> import nrdob
    >>> s = ct.tf('s')
    >>> loop = nrdob.NRDOB(
    ...     process=4 / (-s**2 - s + 2),
    ...     model=-1 / (s**2 + 3*s + 2),
    ...     controller=-1.8 * (0.5*s + 1) / s,
    ...     filter=nrdob.LowPassFilter(0.05, 2),
    ... )
    >>> loop.stability()
    NR-DOB loop: stable
                    N    P    Z   rightmost root
    C Gm (i)        0    0    0   -0.5 + 0.8062j
    F H (ii)       -1    1    0   -1.053
    p_A and p_B have all roots in the left half plane, by encirclements and by roots
    >>> round(loop.margins().plant_loop.ms, 3)
    1.521
    """

    @cached_property
    def _stability(self) -> Stability:
        return stability(self)

    def stability(self) -> Stability:
        """Judge the loop by Lemma 1, each condition in two independent ways.

        Returns
        -------
        Stability
            The verdict, and for C·G̃ and F·H the counts and roots that prove it.
        """
        return self._stability

    def margins(self) -> LoopMargins:
        """Compute the margins of C·G̃, F·H (Lemma 2) and of the plant loop L = K·G.

        Returns
        -------
        LoopMargins
            `.model_loop`, `.observer_loop` and `.plant_loop`, each of which unpacks as
            `control.stability_margins`.
        """
        return loop_margins(self, self._stability)

    step_response = analysis.step_response
    forced_response = analysis.forced_response
    noise_variance = analysis.noise_variance

    def sampled(
        self, dt: float, method: str = "tustin", computation_delay: float = 0.0
    ) -> SampledLoop:
        """Put the controller on a processor: see `nrdob.digital.SampledLoop`.

        Parameters
        ----------
        dt, method, computation_delay : float, {"tustin", "zoh"}, float
            Sampling time in seconds, how the blocks are sampled ("zoh" not with a dead time in the
            model), and the time from reading y to writing u, in seconds.

        Returns
        -------
        SampledLoop
            With `stability()`, `margins()`, `step_response()` and `.controller`, its equations.
        """
        return SampledLoop(self, dt, method, computation_delay)

    def plot_nyquist(
        self, which: str = "FH", *, point: float = -1.0, title: str = "", ax: Any = None
    ) -> Figure:
        """Draw the Nyquist plot of one map with N, P, Z: see `nrdob.plotting.nyquist_plot`.

        Parameters
        ----------
        which : str
            Attribute that holds the map, as "FH", "CGm" or "L".
        point : float
            Point of the real axis to encircle.
        title, ax : str, matplotlib Axes, optional
            Heading, which also enters the alt text, and where to draw.

        Returns
        -------
        Figure
            With `.lines`, `.axes`, `.figure` and `.alt`.
        """
        from .plotting import nyquist_plot

        quotient, found = self._map(which), self._stability
        known = {"CGm": found.model_loop, self.condition_ii.name: found.observer_loop}
        verdict = known.get(which) if point == -1 else None
        return nyquist_plot(quotient, verdict=verdict, point=point, title=title, ax=ax)

    def plot_bode(
        self,
        *which: str,
        omega_limits: tuple[float, float] | None = None,
        title: str = "",
        axes: Any = None,
    ) -> Figure:
        """Draw Bode diagrams, by default F·H; margins where one open loop is drawn alone.

        Parameters
        ----------
        *which : str
            Attributes that hold the maps, as "FH" or "S_d".
        omega_limits : (float, float), optional
            Frequency range in rad/s; by default what there is to see.
        title, axes : str, two matplotlib Axes, optional
            Heading, which also enters the alt text, and where to draw magnitude and phase.

        Returns
        -------
        Figure
            As of `plot_nyquist`.
        """
        from .plotting import bode_plot

        names = which or ("FH",)
        quotients = [self._map(name) for name in names]
        known = {"CGm": "model_loop", self.condition_ii.name: "observer_loop", "L": "plant_loop"}
        alone = len(names) == 1 and names[0] in known
        margins = getattr(self.margins(), known[names[0]]) if alone else None
        return bode_plot(
            *quotients, margins=margins, omega_limits=omega_limits, title=title, axes=axes
        )

    def plot_step(
        self,
        signal: str = "y",
        *,
        compare: LoopEquations | Mapping[str, LoopEquations] | None = None,
        timepts: ArrayLike | None = None,
        title: str = "",
        axes: Any = None,
    ) -> Figure:
        """Draw responses to unit steps of R, d, δ and η: see `nrdob.plotting.step_plot`.

        Parameters
        ----------
        signal : {"y", "u"}
            Output or control signal.
        compare : LoopEquations or dict of str: LoopEquations, optional
            Other loops, three at most, drawn dashed and grey.
        timepts : array_like or float, optional
            Times in seconds, or the last one; by default what there is to see.
        title, axes : str, four matplotlib Axes, optional
            Heading, which also enters the alt text, and where to draw R, d, δ and η.

        Returns
        -------
        Figure
            As of `plot_nyquist`.
        """
        from .plotting import step_plot

        return step_plot(
            self, signal=signal, compare=compare, timepts=timepts, title=title, axes=axes
        )

    def _map(self, name: str) -> Quotient:
        if name not in MAPS:
            raise ValueError(f"there is no map {name!r} to draw; choose one of {', '.join(MAPS)}")
        if self.ill_posed and name in CLOSED_LOOP:
            raise ValueError(f"{name} cannot be drawn: {self.ill_posed}")
        quotient: Quotient = getattr(self, name)
        return quotient
