"""What a parametric fit found: estimates with standard errors and intervals, and how well it suits."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from orbiflow.runtime import Event, Table, p_in_words


@dataclass(frozen=True)
class Parameter:
    """An estimate with its standard error and interval, in `unit`; None where the rows cannot tell.

    The interval of a longitude or an angle may go beyond where the circle begins again.
    """

    name: str
    value: float
    error: float | None
    low: float | None
    high: float | None
    unit: str = ""


@dataclass(frozen=True)
class Goodness:
    """A smooth test whether the rows are of the family: its statistic, degrees of freedom and p.

    - `by`: What p is from: "chi-square", or "resampling" of the fitted density's own draws.
    """

    statistic: float
    degrees: int
    p: float
    by: str


@dataclass(frozen=True)
class ParametricFit:
    """A parametric family at its maximum likelihood.

    - `family`: Its name. `parameters`: The estimates, directions as the data write them.
    - `cones`: Of each direction, half the angle in degrees of a cone that holds the true one.
    - `level`: The level of intervals and cones.
    - `rows`: Rows of equal weight that say as much (Kish).
    - `free`: Number of free parameters.
    - `log_likelihood`, `aic`, `bic`: In nats, in the natural measure, of all rows together.
    - `gain`: Mean log density above that of the uniform density, in nats.
    - `goodness`: A test of the family, None for rows in groups or of other weights.
    """

    family: str
    parameters: tuple[Parameter, ...]
    cones: dict[str, float | None]
    level: float
    rows: float
    free: int
    log_likelihood: float
    aic: float
    bic: float
    gain: float
    goodness: Goodness | None
    notes: tuple[str, ...] = ()

    def __getitem__(self, name: str) -> Parameter:
        """Return the parameter of a name, such as "concentration"."""
        for parameter in self.parameters:
            if parameter.name == name:
                return parameter
        names = ", ".join(parameter.name for parameter in self.parameters)
        raise KeyError(f"{name}; there are {names}")

    def table(self) -> Table:
        """Return the estimates, a line for each."""

        def shown(value: float | None) -> str:
            return "-" if value is None else f"{value:.5g}"

        heads = ("parameter", "estimate", "error", f"{100 * self.level:g} % from", "to", "unit")
        rows = [
            (p.name, *map(shown, (p.value, p.error, p.low, p.high)), p.unit)
            for p in self.parameters
        ]
        return Table(f"Parameters of the {self.family} density", heads, tuple(rows))

    def words(self) -> Iterator[str | Event]:
        """Yield the estimates as a table, and the rest in lines of text."""
        yield self.table()
        yield (
            f"log-likelihood {self.log_likelihood:.4f} nats with {self.free} free parameters, AIC "
            f"{self.aic:.4f}, BIC {self.bic:.4f}"
        )
        for name, angle in self.cones.items():
            size = "the rows cannot tell it" if angle is None else f"half angle {angle:.4g} degrees"
            yield f"cone of {100 * self.level:g} % about {name}: {size}"
        if self.goodness is not None:
            test = self.goodness
            verdict = "the rows suit it" if test.p > 0.05 else "the rows do not suit it"
            yield (
                f"smooth test of the family: {test.statistic:.4g} with {test.degrees} degrees of "
                f"freedom, p {p_in_words(test.p)} by {test.by}: {verdict}"
            )
        yield from self.notes
