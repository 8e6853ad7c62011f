"""Densities of other libraries on angles, directions and rotations, fitted in the same way.

Each function takes rows to train and to stop by, in a box of angles from -pi to pi (`Box`), and gives
the log density per unit of the box at others. Flows are trained by Adam till the held-out rows grow no
likelier (`trained`), FlowJAX's by its own loop with the same patience.
"""

from __future__ import annotations

import copy
import math
import os
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import torch
from density_data import Data
from scipy.spatial.transform import Rotation
from scipy.special import i0e, i1e

EPOCHS, PATIENCE, BATCH, RATE = 2_000, 40, 512, 1e-3
STEPS, COOLED, COOLER = 5_000, 12, 0.3
"""The most steps of a flow, epochs without a gain till its rate falls, and the factor by which."""

Log = Callable[[Data], Data]


class Box(NamedTuple):
    """Rows laid into a box of angles from -pi to pi in which volume is even.

    - `dim`: of the box.
    - `circles`: the coordinates whose ends meet.
    - `shift`: what to add to log densities of the box, so that they are per radian^d, per steradian, or
      for rotations in multiples of the uniform density.
    - `lay`: rows in the units of their space into the box.
    """

    dim: int
    circles: tuple[int, ...]
    shift: float
    lay: Callable[[Data], Data]


def box_of(space: str, dim: int) -> Box:
    """The box of a space: directions lie on a cylinder, rotations by Bunge's angles."""
    if space == "sphere":
        return Box(2, (0,), math.log(math.pi), _cylinder)
    if space == "rotation-space":
        return Box(3, (0, 2), 3 * math.log(2 * math.pi), _bunge)
    return Box(dim, tuple(range(dim)), 0.0, _wrapped)


def _wrapped(angles: Data) -> Data:
    return (angles + math.pi) % (2 * math.pi) - math.pi


def _cylinder(data: Data) -> Data:
    lat, lon = np.radians(data).T
    return np.stack([_wrapped(lon), math.pi * np.sin(lat)], axis=1)


def _bunge(data: Data) -> Data:
    first, middle, last = Rotation.from_quat(data).as_euler("ZXZ").T
    return np.stack([_wrapped(first), math.pi * np.cos(middle), _wrapped(last)], axis=1)


class Size(NamedTuple):
    """Of a flow: width and number of hidden layers, transforms, and bins of a spline."""

    width: int
    depth: int
    transforms: int
    bins: int

    def __str__(self) -> str:
        return f"{self.transforms} x {self.bins} bins, {self.depth} x {self.width}"


SIZES = (Size(128, 2, 3, 8), Size(256, 2, 5, 32))


def zuko(box: Box, train: Data, held: Data, size: Size, seed: int, device: str) -> Log:
    """zuko's NCSF, a neural circular spline flow (Rezende and others, 2020): all ends meet."""
    from zuko.flows import NCSF  # pyright: ignore[reportMissingImports]

    torch.manual_seed(seed)
    hidden = (size.width,) * size.depth
    flow: Any = NCSF(box.dim, bins=size.bins, transforms=size.transforms, hidden_features=hidden)
    return trained(flow, lambda rows: flow().log_prob(rows), train, held, device)


def normflows(box: Box, train: Data, held: Data, size: Size, seed: int, device: str) -> Log:
    """normflows' circular autoregressive spline flow: of the coordinates that are circles alone."""
    import normflows as nf  # pyright: ignore[reportMissingImports]

    torch.manual_seed(seed)
    circles, layers = list(box.circles), []
    for number in range(size.transforms):
        layers.append(
            nf.flows.CircularAutoregressiveRationalQuadraticSpline(
                *(box.dim, size.depth, size.width, circles),
                num_bins=size.bins,
                tail_bound=math.pi,
                permute_mask=number > 0,
            )
        )
        layers.append(nf.flows.PeriodicShift(circles, bound=math.pi, shift=math.pi * number / 2))
    # a point outside by rounding would have no density
    edge = math.pi * (1 + 1e-6)
    flow = nf.NormalizingFlow(nf.distributions.base.Uniform(box.dim, -edge, edge), layers)
    widened = box.dim * math.log1p(1e-6)
    return trained(flow, lambda rows: flow.log_prob(rows) + widened, train, held, device)


def flowjax(box: Box, train: Data, held: Data, size: Size, seed: int, _device: str) -> Log:
    """FlowJAX's autoregressive spline flow in the box: its splines and networks know no circles."""
    os.environ.setdefault("JAX_PLATFORMS", "cpu")
    import jax  # pyright: ignore[reportMissingImports]
    import optax  # pyright: ignore[reportMissingImports]
    from flowjax.bijections import RationalQuadraticSpline  # pyright: ignore[reportMissingImports]
    from flowjax.distributions import Uniform  # pyright: ignore[reportMissingImports]
    from flowjax.flows import masked_autoregressive_flow  # pyright: ignore[reportMissingImports]
    from flowjax.train import fit_to_data  # pyright: ignore[reportMissingImports]

    edge = math.pi * (1 + 1e-6)
    low = jax.numpy.full(box.dim, -edge)
    key, other = jax.random.split(jax.random.key(seed))
    flow = masked_autoregressive_flow(
        key,
        base_dist=Uniform(low, -low),
        transformer=RationalQuadraticSpline(knots=size.bins - 1, interval=edge),
        flow_layers=size.transforms,
        nn_width=size.width,
        nn_depth=size.depth,
    )
    rows = np.concatenate([train, held]).astype(np.float32)
    steps = max(1, len(train) // BATCH)
    epochs = min(EPOCHS, max(1, STEPS // steps))
    flow, _ = fit_to_data(
        other,
        flow,
        jax.numpy.asarray(rows),
        optimizer=optax.adam(optax.cosine_decay_schedule(RATE, epochs * steps, 0.01)),
        max_epochs=epochs,
        max_patience=PATIENCE,
        batch_size=min(BATCH, len(train)),
        val_prop=len(held) / len(rows),
        show_progress=False,
    )
    evaluate = jax.jit(lambda points: flow.log_prob(points))

    def log_density(points: Data) -> Data:
        parts = np.array_split(points.astype(np.float32), max(1, len(points) // 20_000))
        return np.concatenate([np.asarray(evaluate(part), np.float64) for part in parts])

    return log_density


def trained(flow: Any, log_prob: Callable[[Any], Any], train: Data, held: Data, device: str) -> Log:
    """The log density of a flow, trained till `held` grows no likelier and put back to its best."""
    flow.to(device)
    rows, seen = (torch.tensor(own, dtype=torch.float32, device=device) for own in (train, held))
    optimizer = torch.optim.Adam(flow.parameters(), RATE)
    best, kept, waited, steps = math.inf, copy.deepcopy(flow.state_dict()), 0, 0
    for _ in range(EPOCHS):
        for batch in torch.split(torch.randperm(len(rows), device=device), BATCH):
            loss = -log_prob(rows[batch]).mean()
            optimizer.zero_grad()
            loss.backward()
            # one row between two narrow bins can throw a flow off
            torch.nn.utils.clip_grad_norm_(flow.parameters(), 5.0)
            optimizer.step()
            steps += 1
        with torch.no_grad():
            now = float(-log_prob(seen).mean())
        if now < best - 1e-4:
            best, kept, waited = now, copy.deepcopy(flow.state_dict()), 0
        else:
            waited += 1
        if waited >= PATIENCE or steps >= STEPS:
            break
        if waited and waited % COOLED == 0:
            for group in optimizer.param_groups:
                group["lr"] *= COOLER
    flow.load_state_dict(kept)

    @torch.no_grad()
    def log_density(points: Data) -> Data:
        parts = torch.split(torch.tensor(points, dtype=torch.float32), 20_000)
        return torch.cat([log_prob(part.to(device)).double().cpu() for part in parts]).numpy()

    return log_density


COMPONENTS = (4, 8, 16, 32)


def sine_mixture(box: Box, train: Data, held: Data, seed: int) -> tuple[Log, str]:
    """bvvmmm's mixture of bivariate von Mises densities (2026): of two angles, its size by `held`."""
    from bvvmmm.core import SineBVvMMM  # pyright: ignore[reportMissingImports]

    if box.circles != (0, 1):
        raise ValueError("bvvmmm has densities of two angles")
    tried = []
    for count in COMPONENTS:
        if 20 * count <= len(train):
            model = SineBVvMMM(n_components=count, max_iter=100, tol=1e-5, seed=seed, device="cpu")
            model.fit(train)
            tried.append((float(np.mean(np.asarray(model.ln_pdf(held)))), count, model))
    score, count, model = max(tried, key=lambda own: own[0])
    if not math.isfinite(score):
        raise ValueError("bvvmmm gave no finite density")
    return lambda points: np.asarray(model.ln_pdf(points), np.float64), f"{count} components"


KAPPAS = np.geomspace(4, 4e6, 13)


def scikit_learn(train: Data, held: Data, *, signed: bool = True) -> tuple[Log, str]:
    """scikit-learn's KernelDensity of angles as cosines and sines, or of unit vectors.

    There a Gaussian kernel of width h is exp(-|x - y|^2 / 2 h^2), which on circles and spheres is a von
    Mises or von Mises-Fisher kernel of concentration 1 / h^2 but for its constant. That is put right
    here: by itself, the estimate is a density of the space about them and has no integral on them.

    Args:
        train: (N, 2 d), cosines and sines in turn, or unit vectors (N, 3), or quaternions (N, 4).
        held: The rows that choose the width.
        signed: Whether they are no quaternions, of which both signs are one rotation.
    """
    from sklearn.neighbors import KernelDensity  # pyright: ignore[reportMissingImports]

    width = train.shape[1]

    def log_integral(kappa: float) -> float:
        """Logarithm of the kernel's integral, of quaternions of its mean over both signs."""
        if not signed:
            return math.log(4 * i1e(kappa) / kappa)
        if width == 3:
            return math.log(2 * math.pi / kappa) + math.log1p(-math.exp(-2 * kappa))
        return width / 2 * math.log(2 * math.pi * i0e(kappa))

    def log_density(model: Any, kappa: float, points: Data) -> Data:
        log = model.score_samples(points)
        if not signed:
            log = np.logaddexp(log, model.score_samples(-points))
        return log + width / 2 * math.log(2 * math.pi / kappa) - log_integral(kappa)

    tried = []
    for kappa in KAPPAS.tolist():
        # its stub has a whole number for the tolerance
        exact: dict[str, Any] = {"rtol": 1e-4}
        model = KernelDensity(bandwidth=kappa**-0.5, **exact).fit(train)
        tried.append((float(log_density(model, kappa, held[:1000]).mean()), kappa, model))
    _, kappa, model = max(tried, key=lambda own: own[0])
    return lambda points: log_density(model, kappa, points), f"width {kappa**-0.5:.2g}"
