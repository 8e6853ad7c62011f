"""Figures of a fitted density in the data's own columns and units."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from numpy.typing import ArrayLike
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.inference.angles import axes_named
from orbiflow.density.inference.shortest import shortest_intervals
from orbiflow.density.inference.trends import Trend, pair_alone, trend
from orbiflow.density.models import Density, Estimate
from orbiflow.density.spaces import Space
from orbiflow.settings import as_instance, as_tensor


class FittedFigures:
    """What an estimator tells of its density beside log densities and samples."""

    space_: Space
    _fitted: Callable[[], Density]
    _chart: Callable[[Array], Tensor]
    _checked: Callable[[ArrayLike], Array]
    _column_names: Callable[[], list[str]]

    def mean(self) -> Array:
        """The mean direction of each angle and the mean of each real column, or of directions: (k,).

        Raises `OrbiflowError` before `fit`, and on spaces whose points have no mean (`Density.mean`).
        """
        return self.space_.from_chart(self._fitted().mean[None])[0]

    def mode(self) -> Array:
        """The data (k,) at which the density in natural measure is highest, as far as was found."""
        return self.space_.from_chart(self._fitted().mode[None])[0]

    def cdf(self, X: ArrayLike) -> Array:
        """The masses (N,) up to data (N, 1) of the only column, from where it begins.

        A circle is cut opposite its mean direction, `mean`, wherever the data are (half a turn from 0
        if it has none), so angles may be written in any turn; a real column begins at minus infinity.
        Of several columns take `marginal` first.
        """
        return self._fitted().cdf(self._chart(self._checked(X))).numpy()

    def quantile(self, masses: ArrayLike) -> Array:
        """The values (N,) of the only column up to which there are these masses (N,), from 0 to 1.

        Masses begin where those of `cdf` do: the median is 0.5. Angles are as the data of the fit: from
        0 to a whole turn if none was negative and one half a turn or more, otherwise from minus half
        a turn. So a quantile may be written as less than a lower one (350, 10): for an interval ask
        `interval`.
        """
        points = self._fitted().icdf(as_tensor(masses, "masses").reshape(-1))
        return self.space_.from_chart(points)[:, 0]

    def interval(self, mass: float) -> Array:
        """The ends (m, 2) of the shortest interval of the only column, or intervals, that hold a mass.

        Where the density in natural measure has one peak, there is one, otherwise there may be several
        that hold it together, in order. On a circle they are arcs: each begins at an angle that is
        written as data are (see `quantile`), and its end is more, if need be more than any data: an arc
        through north is from 350 to 370, or from -10 to 10.

        Raises `OrbiflowError` for a mass below 0.001 or above 0.999999, and for several columns.
        """
        return shortest_intervals(self._fitted(), mass)

    def entropy(self, *, measure: str = "natural") -> Estimate:
        """-E[log p] in nats with its standard error, the same every time."""
        return self._fitted().estimated_entropy(measure=measure)

    def kl_divergence(self, other: FittedFigures | Density) -> Estimate:
        """E[log p - log q] in nats, of another density q from this one, with its standard error."""
        density = other._fitted() if isinstance(other, FittedFigures) else other
        return self._fitted().divergence(as_instance(density, Density, "other"))

    def trend(
        self,
        of: str | int,
        along: str | int,
        at: ArrayLike,
        *,
        levels: Sequence[float] = (0.5, 0.9),
    ) -> Trend:
        """How one column goes with another: means and intervals at values (n,) of `along`.

        Columns are names or numbers from 0; see `orbiflow.density.inference.trend`.
        """
        density, names = self._fitted(), self._column_names()
        first, second = axes_named([of, along], names)
        return trend(*pair_alone(density, first, second, len(names)), at, levels=levels)
