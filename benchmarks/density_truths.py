"""How near `density fit` comes to densities that are known: nats lost, on all kinds of spaces.

    python benchmarks/density_truths.py [--rows 2000] [--quick] [SET ...]

Sets are lines (one real column), mixed (angles, directions, axes and rotations beside real columns),
spheres (of 1 to 9 dimensions, axes, rotations, crystals), quotients (plane orbifolds and flat
3-manifolds), or names of these. Regret is the mean of log truth over log density at 5,000 rows that no
fit has seen, with its standard error: of the default, and of a kernel estimate. Of real columns its
product kernels have one bandwidth for the angles or the direction and one for each other column, chosen
by leaving rows out, and are in the logarithms of positive columns and the logits of bounded ones.
Elsewhere it has the width that is best on 2,000 other rows of the truth, which no user would have.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
import torch
from density_data import Data
from scipy import optimize, special, stats
from torch import Tensor

from orbiflow.density import (
    AdaptiveKernels,
    DensityEstimator,
    Mixture,
    QuotientSpace,
    RotationSpace,
    Space,
    UniformDensity,
    make_space,
)
from orbiflow.density.fitting.kernels import kernel_estimates
from orbiflow.density.fitting.rows import Rows
from orbiflow.symmetry import FLAT_MANIFOLDS, WALLPAPER_GROUPS

UNSEEN, TUNING = 5_000, 2_000


class Known(NamedTuple):
    """How rows (N, k) are drawn, their log density (N,), the roles of columns beside the space.

    Of directions, axes and rotations the first `width` columns are a unit vector.
    """

    draw: Callable[[int, np.random.Generator], Data]
    log: Callable[[Data], Data]
    roles: Mapping[int, str] = {}
    space: Any = "torus"
    width: int = 0

    def fitted(self, data: Data) -> DensityEstimator:
        """What `density fit` makes of rows."""
        unit = "radians" if self.space == "torus" else None
        columns = [
            f"{k + 1}={self.roles[k]}" if k in self.roles else f"{k + 1}"
            for k in range(data.shape[1])
        ]
        return DensityEstimator(self.space, columns=",".join(columns), unit=unit).fit(data)


def _cylinder(count: int, rng: np.random.Generator) -> Data:
    angle = rng.vonmises(0, 2, count)
    return np.column_stack([angle, 3 + np.cos(angle) / 2 + 0.2 * rng.normal(size=count)])


def _log_cylinder(x: Data) -> Data:
    line = stats.norm.logpdf(x[:, 1], 3 + np.cos(x[:, 0]) / 2, 0.2)
    return stats.vonmises.logpdf(x[:, 0], 2) + line


STATES = (  # weight, mean angles, their concentration, mean length, its deviation
    (0.5, (-1.1, -0.7), 12.0, 1.53, 0.012),
    (0.3, (-2.2, 2.4), 8.0, 1.51, 0.015),
    (0.2, (1.0, 0.6), 20.0, 1.55, 0.008),
)


def _backbone(count: int, rng: np.random.Generator) -> Data:
    chosen = rng.choice(len(STATES), count, p=[own[0] for own in STATES])
    kappa = np.array([STATES[k][2] for k in chosen])
    angles = rng.vonmises(np.array([STATES[k][1] for k in chosen]), kappa[:, None])
    lengths = rng.normal(*np.array([STATES[k][3:] for k in chosen]).T)
    return np.column_stack([angles, lengths])


def _log_backbone(x: Data) -> Data:
    terms = [
        np.log(weight)
        + np.asarray(stats.vonmises.logpdf(x[:, :2], kappa, loc=means)).sum(axis=1)
        + stats.norm.logpdf(x[:, 2], length, spread)
        for weight, means, kappa, length, spread in STATES
    ]
    return special.logsumexp(terms, axis=0)


def _season(count: int, rng: np.random.Generator) -> Data:
    """A day of the year, a heavy-tailed temperature, a wind of a log-normal speed."""
    day = rng.uniform(-np.pi, np.pi, count)
    warm = 10 - 9 * np.cos(day) + 3 * rng.standard_t(4, size=count)
    speed = np.exp(1 + 0.3 * np.cos(day) + 0.5 * rng.normal(size=count))
    return np.column_stack([day, warm, speed])


def _log_season(x: Data) -> Data:
    day, warm, speed = x.T
    logs = stats.t.logpdf(warm, 4, 10 - 9 * np.cos(day), 3) - np.log(2 * np.pi)
    return logs + stats.lognorm.logpdf(speed, 0.5, scale=np.exp(1 + 0.3 * np.cos(day)))


def _log_fisher(kappa: Data, width: int) -> Data:
    """Log density of a von Mises-Fisher distribution at its mean, per area of the sphere."""
    order = width / 2 - 1
    peak = order * np.log(kappa) - width / 2 * np.log(2 * np.pi)
    return peak - np.log(special.ive(order, kappa))


def _about(mean: Data, kappa: float, rng: np.random.Generator) -> Data:
    """One von Mises-Fisher draw (N, m) about each mean (N, m)."""
    first = np.eye(mean.shape[1])[0]
    own: Any = stats.vonmises_fisher
    drawn = own(first, kappa).rvs(len(mean), random_state=rng)
    off = first - mean  # Householder's reflection takes the first axis to the mean
    size = (off**2).sum(axis=1, keepdims=True)
    return drawn - 2 * off * (drawn * off).sum(axis=1, keepdims=True) / np.maximum(size, 1e-300)


def _unit(vectors: Data) -> Data:
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def _of_day(day: Data) -> Data:
    turn = 2 * np.pi * day / 365
    return _unit(np.column_stack([np.cos(turn), np.sin(turn), np.full(len(day), 0.5)]))


def _place(count: int, rng: np.random.Generator) -> Data:
    """A direction that goes around in a year, and a depth that goes with its height."""
    day = rng.uniform(0, 365, count)
    vectors = _about(_of_day(day), 20, rng)
    return np.column_stack([vectors, day, 10 + 4 * vectors[:, 2] + rng.normal(size=count)])


def _log_place(x: Data) -> Data:
    vectors, day, depth = x[:, :3], x[:, 3], x[:, 4]
    cosine = (vectors * _of_day(day)).sum(axis=1)
    logs = _log_fisher(np.array(20.0), 3) + 20 * (cosine - 1) - np.log(365)
    return logs + stats.norm.logpdf(depth, 10 + 4 * vectors[:, 2])


def _folded(x: Data, mean: Data, kappa: Data) -> Data:
    cosine = (x * mean).sum(axis=1)
    both = np.logaddexp(kappa * (cosine - 1), kappa * (-cosine - 1))
    return _log_fisher(kappa, x.shape[1]) + both


def _of_depth(depth: Data) -> tuple[Data, Data]:
    """Mean axis and concentration of fibres at a depth."""
    angle = np.pi * depth
    mean = np.column_stack([np.cos(angle), np.sin(angle), 0 * depth])
    return mean, 6 + 30 * depth


def _fibres(count: int, rng: np.random.Generator) -> Data:
    """Axes that turn and tighten with depth, as collagen in a cartilage does."""
    depth = rng.beta(2, 2, count)
    mean, kappa = _of_depth(depth)
    near = np.array([_about(m[None], k, rng)[0] for m, k in zip(mean, kappa, strict=True)])
    return np.column_stack([near, depth])


def _log_fibres(x: Data) -> Data:
    return _folded(x[:, :3], *_of_depth(x[:, 3])) + stats.beta.logpdf(x[:, 3], 2, 2)


def _of_strain(strain: Data) -> Data:
    half = strain / 2
    return np.column_stack([0.3 * np.ones_like(half), 0.2 * half, np.sin(half), np.cos(half)])


def _rolled(count: int, rng: np.random.Generator) -> Data:
    """Rotations (quaternions) that turn about one axis with a strain."""
    strain = rng.normal(0.5, 0.4, count)
    return np.column_stack([_about(_unit(_of_strain(strain)), 60, rng), strain])


def _log_rolled(x: Data) -> Data:
    turned = _folded(x[:, :4], _unit(_of_strain(x[:, 4])), np.array(60.0))
    return turned + stats.norm.logpdf(x[:, 4], 0.5, 0.4)


MIXED = {
    "cylinder": Known(_cylinder, _log_cylinder, {1: "linear"}),
    "backbone": Known(_backbone, _log_backbone, {2: "linear"}),
    "season": Known(_season, _log_season, {1: "linear", 2: "positive"}),
    "place": Known(_place, _log_place, {4: "linear", 3: "cycle:365"}, "sphere", 3),
    "fibres": Known(_fibres, _log_fibres, {3: "linear"}, "projective-plane", 3),
    "rolled": Known(
        _rolled, _log_rolled, {4: "linear"}, make_space("rotation-space", form="quaternion"), 4
    ),
}


class _WithOutliers:
    """Nine in ten of one distribution, and one in ten of a wider one."""

    usual, other = stats.gamma(9, scale=1.0), stats.gamma(2, scale=20.0)

    def rvs(self, count: int, random_state: np.random.Generator) -> Data:
        """Return draws (count,)."""
        is_other = random_state.random(count) < 0.1
        draws = [one.rvs(count, random_state=random_state) for one in (self.usual, self.other)]
        return np.where(is_other, draws[1], draws[0])

    def logpdf(self, x: Data) -> Data:
        """Return log densities (N,)."""
        return np.logaddexp(np.log(0.9) + self.usual.logpdf(x), np.log(0.1) + self.other.logpdf(x))


LINES: dict[str, tuple[Any, str]] = {
    "normal": (stats.norm(3, 0.2), "linear"),
    "student-2": (stats.t(2), "linear"),
    "log-normal-1.5": (stats.lognorm(1.5), "positive"),
    "log-normal-2.5": (stats.lognorm(2.5), "positive"),
    "pareto-1.5": (stats.pareto(1.5), "positive"),
    "gamma-0.7": (stats.gamma(0.7), "positive"),
    "outliers": (_WithOutliers(), "positive"),
    "beta-0.5-2": (stats.beta(0.5, 2), "bounded:0:1"),
}


def line(true: Any, role: str) -> Known:
    """One real column of a known distribution."""
    return Known(
        lambda count, rng: true.rvs(count, random_state=rng)[:, None],
        lambda x: true.logpdf(x[:, 0]),
        {0: role},
    )


class OnSpace(NamedTuple):
    """A density on a space: its points, and its logarithm in natural measure."""

    draw: Callable[[int, torch.Generator], Tensor]
    log_prob: Callable[[Tensor], Tensor]


def clusters(space: Space) -> OnSpace:
    """Six clusters of deviations 5 to 30 degrees, and a tenth even."""
    kappa = torch.tensor([130.0, 60.0, 30.0, 20.0, 10.0, 4.0], dtype=torch.float64)
    weights = torch.full((6,), 1 / 6, dtype=torch.float64)
    centers = space.uniform(6, torch.Generator().manual_seed(1))
    width = space.dim if space.has_chart else 1
    kernels = AdaptiveKernels(space, centers, kappa[:, None].expand(-1, width), weights)
    both = Mixture([kernels, UniformDensity(space)], [0.9, 0.1])
    return OnSpace(
        lambda count, generator: both.sample(count, generator),
        lambda points: both.log_prob(points, measure="natural"),
    )


def gaussian(space: Space) -> OnSpace:
    """Directions of a Gaussian vector whose deviations fall from 1 to 1/10, both ends alike.

    Its density is |S|^(-1/2) (x' S^-1 x)^(-m/2) over the area of the sphere, summed over images (Tyler,
    Statistical analysis for the angular central Gaussian distribution on the sphere, 1987).
    """
    size = space.chart_dim
    scale = torch.tensor(np.geomspace(1, 0.1, size))
    images = space.features(space.uniform(1, torch.Generator()))
    log_area = float(np.log(space.volume * len(images)))

    def draw(count: int, generator: torch.Generator) -> Tensor:
        noise = torch.randn(count, size, dtype=torch.float64, generator=generator) * scale
        return space.project(noise / noise.norm(dim=1, keepdim=True))

    def log_prob(points: Tensor) -> Tensor:
        square = ((space.features(points) / scale) ** 2).sum(dim=-1)
        return (-size / 2 * square.log()).logsumexp(dim=0) - scale.log().sum() - log_area

    return OnSpace(draw, log_prob)


def fibre(space: Space) -> OnSpace:
    """Rotations that turn one axis nearly to another: exp(25 (x1^2 + x2^2)) on the sphere S^3.

    There x1^2 + x2^2 is even between 0 and 1, so that the integral is 2 pi^2 (e^25 - 1) / 25.
    """
    kappa = 25.0
    log_total = float(np.log(2 * np.pi**2 * np.expm1(kappa) / kappa))

    def draw(count: int, generator: torch.Generator) -> Tensor:
        part = torch.rand(3, count, dtype=torch.float64, generator=generator)
        square = (1 + part[0] * np.expm1(kappa)).log() / kappa
        near, far = square.sqrt(), (1 - square).clamp_min(0).sqrt()
        first, second = 2 * np.pi * part[1:]
        rows = [near * first.cos(), near * first.sin(), far * second.cos(), far * second.sin()]
        return space.project(torch.stack(rows, dim=1))

    def log_prob(points: Tensor) -> Tensor:
        square = (space.features(points)[..., :2] ** 2).sum(dim=-1)
        return (kappa * square).logsumexp(dim=0) - log_total

    return OnSpace(draw, log_prob)


def on(space: Space, make: Callable[[Space], OnSpace]) -> Known:
    """A density on a space, of rows as the space writes them."""
    truth = make(space)

    def draw(count: int, rng: np.random.Generator) -> Data:
        generator = torch.Generator().manual_seed(int(rng.integers(2**32)))
        return space.from_chart(truth.draw(count, generator))

    @torch.no_grad()
    def log(rows: Data) -> Data:
        return truth.log_prob(space.to_chart(rows)).numpy()

    return Known(draw, log, space=space)


DIMENSIONS = (1, 2, 3, 5, 9)
SPHERES: dict[str, Callable[[], Known]] = {
    **{
        f"{title}-{dim}": lambda name=name, dim=dim, make=make: on(make_space(name, dim=dim), make)
        for title, name, make in (
            ("sphere", "hypersphere", clusters),
            ("axes", "projective-space", gaussian),
        )
        for dim in DIMENSIONS
    },
    **{
        f"{name}{end}": lambda crystal=crystal, make=make: on(RotationSpace(symmetry=crystal), make)
        for name, crystal in (("rotations", None), ("hexagonal", "622"), ("cubic", "432"))
        for end, make in (("", clusters), ("-fibre", fibre))
    },
}
QUOTIENTS: dict[str, Callable[[], Known]] = {
    name: lambda name=name: on(QuotientSpace(name), clusters)
    for name in (*FLAT_MANIFOLDS, *WALLPAPER_GROUPS)
}
KINDS: dict[str, dict[str, Callable[[], Known]]] = {
    "lines": {name: lambda own=own: line(*own) for name, own in LINES.items()},
    "mixed": {name: lambda known=known: known for name, known in MIXED.items()},
    "spheres": SPHERES,
    "quotients": QUOTIENTS,
}
SETS = {name: make for kind in KINDS.values() for name, make in kind.items()}


@torch.no_grad()
def best_width(data: Data, unseen: Data, known: Known) -> Data:
    """Log densities (M,) of the kernels of the width that is best on other rows of the truth."""
    space = known.space
    other = known.draw(TUNING, np.random.default_rng(3))
    kernels = kernel_estimates(space, Rows(space.to_chart(data)))
    # a hundredth is even, or one lone point would cost any number of nats
    tried = [
        Mixture([one, UniformDensity(space)], [0.99, 0.01])
        for name, one in kernels.items()
        if name.startswith("width")
    ]

    def logs(density: Mixture, rows: Data) -> Data:
        return density.log_prob(space.to_chart(rows), measure="natural").numpy()

    return logs(max(tried, key=lambda one: float(logs(one, other).mean())), unseen)


def kernel_estimate(data: Data, unseen: Data, known: Known) -> Data:
    """Log densities (M,) of a product kernel estimate, whose bandwidths leaving out rows has chosen."""
    width = known.width
    real = [k for k, role in known.roles.items() if not role.startswith("cycle")]
    around = {k: 1.0 for k in range(width, data.shape[1]) if k not in real}
    around |= {
        k: 2 * np.pi / float(role.removeprefix("cycle:"))
        for k, role in known.roles.items()
        if k not in real
    }
    slopes = np.zeros(len(unseen))
    data, unseen = data.copy(), unseen.copy()
    for k in real:
        values = unseen[:, k]
        if known.roles[k] == "positive":
            slopes += np.log(values)
            data[:, k], unseen[:, k] = np.log(data[:, k]), np.log(values)
        elif known.roles[k] == "bounded:0:1":
            slopes += np.log(values) + np.log1p(-values)
            data[:, k], unseen[:, k] = special.logit(data[:, k]), special.logit(values)
    first, others_around = ([], list(around)) if width else (list(around), [])

    def turned(at: Data, k: int, kappa: float) -> Data:
        cosine = np.cos(around[k] * (at[:, None, k] - data[None, :, k]))
        return kappa * (cosine - 1) - np.log(2 * np.pi / around[k] * special.ive(0, kappa))

    def table(at: Data, widths: Data, others: int) -> Data:
        total = np.full((len(at), len(data)), -np.log(others))
        kappa, *rest = np.exp(widths)  # of a line alone nothing has the first
        for k in first:
            total += turned(at, k, kappa)
        if width:
            cosine = at[:, :width] @ data[:, :width].T
            fold = np.logaddexp(kappa * (cosine - 1), kappa * (-cosine - 1))
            own = kappa * (cosine - 1) if known.space == "sphere" else fold
            total += own + _log_fisher(np.array(kappa), width)
        for size, k in zip(rest, [*real, *others_around], strict=True):
            if k in real:
                total += stats.norm.logpdf(at[:, None, k], data[None, :, k], size)
            else:
                total += turned(at, k, size)
        return total

    some = data[:800]
    start = np.array(
        [3.0, *(np.log(some[:, k].std() / 4) for k in real), *(3.0 for _ in others_around)]
    )

    def loss(widths: Data) -> float:
        total = table(some, widths, len(data) - 1)
        np.fill_diagonal(total, -np.inf)
        return -float(special.logsumexp(total, axis=1).mean())

    widths = optimize.minimize(loss, start, method="Nelder-Mead", options={"maxiter": 120}).x
    parts = np.array_split(unseen, 20)
    logs = [special.logsumexp(table(part, widths, len(data)), axis=1) for part in parts]
    return np.concatenate(logs) - slopes


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("sets", nargs="*", metavar="SET", default=list(KINDS))
    parser.add_argument("--rows", type=int, default=2_000)
    parser.add_argument("--quick", action="store_true", help="200 rows of one set of each kind")
    given = parser.parse_args()
    names = [name for one in given.sets for name in KINDS.get(one, [one])]
    if unknown := set(names) - set(SETS):
        parser.error(f"unknown: {', '.join(sorted(unknown))}; there are {', '.join(SETS)}")
    if given.quick:
        names, given.rows = ["cylinder", "sphere-2", "pgg"], 200
    print(f"{'set':28} {'rows':>6} {'default':>8} {'+-':>7} {'kernels':>8} {'seconds':>8}")
    for name in names:
        known, rng = SETS[name](), np.random.default_rng(0)
        data, unseen = known.draw(given.rows, rng), known.draw(UNSEEN, rng)
        begin = time.process_time()
        fit = known.fitted(data)
        seconds = time.process_time() - begin
        truth = known.log(unseen)
        lost = truth - fit.score_samples(unseen)
        rival = kernel_estimate if known.roles else best_width
        theirs = float((truth - rival(data, unseen, known)).mean())
        error = float(lost.std()) / len(lost) ** 0.5
        figures = f"{float(lost.mean()):8.4f} {error:7.4f} {theirs:8.4f} {seconds:8.1f}"
        print(f"{name:28} {len(data):6} {figures}", flush=True)


if __name__ == "__main__":
    main()
