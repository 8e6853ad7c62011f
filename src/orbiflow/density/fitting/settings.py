"""Settings of a fit: which components a density may have, and how its flow is trained."""

from __future__ import annotations

from typing import Annotated, Any, Literal, get_args

from orbiflow.errors import SettingError
from orbiflow.settings import DefaultText, HelpHeading, Hidden, Parsed, Range, Settings, fields_of

Component = Literal[
    "flow", "kernels", "mixture", "chains", "network", "von-mises", "von-mises-sine",
    "von-mises-fisher", "kent", "watson", "bingham", "angular-central-gaussian", "matrix-fisher",
]  # fmt: skip
Seed = Annotated[int, Range(-(2**63), 2**64 - 1)]

KNOWN: tuple[str, ...] = get_args(Component)
"""All components, in their order."""

COMPONENTS = KNOWN[:5]
"""What a density may be made of, beside its uniform floor, if nothing else is asked for."""

FAST_COMPONENTS = ("kernels", "mixture")
"""What it may be made of with effort "fast"."""

PARAMETRIC = KNOWN[5:]
"""Parametric families: alone each is a fit of its own, beside others it is one of the candidates."""

REPORTED = (
    "components", "effort", "repeats", "missing", "max_frequency", "segments", "seed",
)  # fmt: skip
"""Settings of a fit that its report repeats, and an estimator has again when it is loaded."""

FLOW = HelpHeading("Flow")


def component_names(text: str) -> tuple[str, ...] | None:
    """Return the components that a text names, such as "kernels,mixture"; None for "auto"."""
    if text.strip() == "auto":
        return None
    return tuple(name.strip() for name in text.split(",") if name.strip())


class ComponentSettings(Settings, group="Density"):
    """Which components a density may have; data that were held out choose among them."""

    components: Annotated[
        tuple[Component, ...] | None,
        Parsed(component_names, "names such as kernels,mixture"),
        DefaultText("flow,kernels,mixture,chains,network"),
    ] = None
    """Components that may be used, such as kernels,mixture; held-out data choose among them. Chains are
    for tori of two or more angles, a network for more than three, a flow for three dimensions at most,
    tried by itself in two. One parametric family alone, such as von-mises-fisher, is fitted with
    intervals of its parameters."""

    repeats: Literal["auto", "places", "rounding"] = "auto"
    """What rows that repeat another are. Places: new rows repeat them as often. Rounding: an accident,
    and the density has no peaks there. Auto: rounding where it explains the repeats, else places."""

    effort: Literal["fast", "normal"] = "normal"
    """How much is tried. Fast: kernels and mixtures alone, judged by half of the tenths at most, and
    where covariates are known no networks and no joint density."""

    seed: Seed = 0
    """Seed of the random numbers: the same seed on the same machine gives the same density."""

    @property
    def is_fast(self) -> bool:
        """Whether little is tried."""
        return self.effort == "fast"

    @property
    def allowed(self) -> tuple[str, ...]:
        """The components that may be used."""
        if self.components is None:
            return FAST_COMPONENTS if self.is_fast else COMPONENTS
        return self.components

    @property
    def left_out(self) -> list[str]:
        """Notes of what the effort leaves out, for the report of a fit."""
        if not self.is_fast:
            return []
        untried = [name for name in COMPONENTS if name not in self.allowed]
        names = f"; {', '.join(untried)} not tried" if self.components is None else ""
        return [f"effort fast: judged by half of the tenths at most{names}"]


class FlowOptions(Settings, group="Flow"):
    """How a flow is trained, where None is what suits the data."""

    max_frequency: Annotated[int | None, Range(1, 64), FLOW, DefaultText("what suits the rows")] = (
        None
    )
    """Largest wave number of the flow, in waves along a side of the square."""

    segments: Annotated[int | None, Range(1, 256), FLOW, DefaultText("what suits the rows")] = None
    """Number of stationary pieces of the flow."""

    roughness: Annotated[
        tuple[Annotated[float, Range(0)], ...] | None, Hidden(), DefaultText("what suits the rows")
    ] = None
    """Weights of the roughness penalty, largest first: each is a stage of refinement, which starts
    where the one before was best on held-out points."""

    iterations: Annotated[
        int | None, Range(0, 100_000), Hidden(), DefaultText("what suits the rows")
    ] = None
    """Maximum number of iterations of L-BFGS in each stage; 0 keeps the closed-form start."""

    evaluations: Annotated[int, Range(0, 1_000_000_000), Hidden()] = 1000
    """Maximum number of evaluations of the likelihood and its gradient in all stages together. A stage
    of 100 iterations takes about 105."""

    validation: Annotated[float, Range(above=0, below=1), Hidden()] = 0.1
    """Share of the points held out for early stopping."""


class FlowSettings(FlowOptions, group="Flow"):
    """How a flow is trained; the defaults are measured on the benchmarks."""

    max_frequency: Annotated[int, Range(1, 64)] = 8
    segments: Annotated[int, Range(1, 256)] = 6
    roughness: tuple[Annotated[float, Range(0)], ...] = (1e-3, 1e-3, 1e-4)
    iterations: Annotated[int, Range(0, 100_000)] = 100

    seed: Seed = 0
    """Seed of the split, the base points and the times."""

    def check(self) -> None:
        """Check that there is a stage of refinement."""
        if not self.roughness:
            raise SettingError("{roughness} must be one weight or more, such as 1e-3")


class DensitySettings(FlowOptions, ComponentSettings, group="Density"):
    """How a density is fitted."""

    def check(self) -> None:
        """Check that what is set of a flow has one, and that effort leaves anything to fit."""
        if self.is_fast and self.flow_alone:
            raise SettingError(
                "{effort} fast tries no flow: add kernels to {components}, or leave {effort} out"
            )
        for name in ("max_frequency", "segments"):
            if getattr(self, name) is not None and "flow" not in self.allowed:
                raise SettingError(
                    f"{{{name}}} needs a flow: add flow to {{components}}, or leave {{{name}}} out"
                )

    @property
    def parametric(self) -> str | None:
        """The parametric family that is fitted alone."""
        names = self.components or ()
        return names[0] if len(names) == 1 and names[0] in PARAMETRIC else None

    @property
    def flow_alone(self) -> bool:
        """Whether there is nothing to choose."""
        return self.components == ("flow",)

    def check_rows(self, missing: str, groups: str | None = None) -> None:
        """Refuse what a flow alone cannot be fitted to; `groups` are known by their argument's name."""
        if self.flow_alone and missing == "marginalise":
            raise SettingError(
                "{missing} marginalise is for kernels and mixtures: a flow cannot be fitted to rows "
                "that lack angles; give other {components}"
            )
        if self.parametric and missing == "marginalise":
            raise SettingError(
                f"a {self.parametric} density cannot be fitted to rows that lack angles: use "
                "{missing} drop"
            )
        if self.flow_alone and groups is not None:
            raise SettingError(
                f"{{{groups}}} serves to choose among {{components}}, and a flow alone has no choice; "
                "leave it out"
            )

    @property
    def flow(self) -> FlowSettings:
        """Settings of a flow that is fitted alone."""
        return FlowSettings(seed=self.seed, **self.of_flow)

    @property
    def of_flow(self) -> dict[str, Any]:
        """What was given of a flow, by name."""
        names = [entry.name for entry in fields_of(FlowOptions)]
        values = {name: getattr(self, name) for name in names if name in self.fields_given}
        return {name: value for name, value in values.items() if value is not None}
