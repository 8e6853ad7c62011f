"""What a parametric fit found: estimates with standard errors and intervals, and how well it suits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any


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
        for one in self.parameters:
            if one.name == name:
                return one
        raise KeyError(f"{name}; there are {', '.join(one.name for one in self.parameters)}")

    def to_json(self) -> dict[str, Any]:
        """Return an object for `json.dumps`."""
        return asdict(self)

    def words(self) -> list[str]:
        """Return what is not in the table of parameters, in lines of text."""
        lines = [
            f"log-likelihood {self.log_likelihood:.4f} nats with {self.free} free parameters, AIC "
            f"{self.aic:.4f}, BIC {self.bic:.4f}"
        ]
        for name, angle in self.cones.items():
            size = "the rows cannot tell it" if angle is None else f"half angle {angle:.4g} degrees"
            lines.append(f"cone of {100 * self.level:g} % about {name}: {size}")
        if self.goodness is not None:
            found = self.goodness
            verdict = "the rows suit it" if found.p > 0.05 else "the rows do not suit it"
            p = f"{found.p:.2g}" if found.p > 1e-300 else "< 1e-300"
            lines.append(
                f"smooth test of the family: {found.statistic:.4g} with {found.degrees} degrees of "
                f"freedom, p {p} by {found.by}: {verdict}"
            )
        return [*lines, *self.notes]


def parametric_fit_from(document: Mapping[str, Any]) -> ParametricFit:
    """Return a parametric fit from the object that `ParametricFit.to_json` returns."""
    values: dict[str, Any] = dict(document)
    values["parameters"] = tuple(Parameter(**entry) for entry in values["parameters"])
    values["notes"] = tuple(values["notes"])
    if values["goodness"] is not None:
        values["goodness"] = Goodness(**values["goodness"])
    return ParametricFit(**values)
