"""The paper's method: occupancy loss, affine phase, then flow phase (paper, section 4.1)."""

# pyright: reportUnknownMemberType=false
# shapely's stubs leave the keyword arguments of its functions of arrays without types.

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import shapely
import torch
import torch.nn.functional as F
from torch import Tensor

from orbiflow.flows import Adam
from orbiflow.runtime import NEVER, Cancel
from orbiflow.settings import as_instance, as_whole
from orbiflow.tiles.flowing.descent import between
from orbiflow.tiles.flowing.soft_target import signed_distance
from orbiflow.tiles.flowing.starts import initial_poses
from orbiflow.tiles.flowing.tile_model import TileModel
from orbiflow.tiles.search import OnProgress, SearchMethod, silent, template_symmetries
from orbiflow.tiles.silhouette import Target
from orbiflow.tiles.tilings import IsohedralClass, isohedral_class
from orbiflow.typed_torch import linalg, listed

if TYPE_CHECKING:
    from orbiflow.tiles.flowing.overlap_search import OccupancySearch

# Factor of the squared displacement of a pentagon's free vertex: keeps the template simple
SHAPE_PENALTY = 0.02


class OccupancySamples:
    """Points around a target and whether it contains them: the paper's Q and o(q).

    A third is uniform in the target's bounding box with a margin of 0.2, the rest normally scattered
    about the outline (standard deviations 0.02, 0.06, 0.15): far points teach little.
    """

    def __init__(
        self, target: Target, count: int, *, seed: int, dtype: torch.dtype = torch.float32
    ) -> None:
        as_instance(target, Target, "the target", "Target.read and Target.from_polygon make one")
        as_whole(count, "count", 1)
        rng = np.random.default_rng(seed)
        region = shapely.Polygon(target.normal)
        uniform = count // 3
        along = rng.random(count - uniform) * region.exterior.length
        near = shapely.get_coordinates(shapely.line_interpolate_point(region.exterior, along))
        spread = rng.choice([0.02, 0.06, 0.15], size=(len(near), 1))
        near += spread * rng.standard_normal(near.shape)
        low, high = target.normal.min(axis=0) - 0.2, target.normal.max(axis=0) + 0.2
        points = np.concatenate([low + (high - low) * rng.random((uniform, 2)), near])
        inside = shapely.contains_xy(region, points[:, 0], points[:, 1])
        self.points = torch.tensor(points, dtype=dtype)
        self.inside = torch.tensor(inside, dtype=dtype)
        self._generator = torch.Generator().manual_seed(seed)

    def draw(self, count: int) -> tuple[Tensor, Tensor]:
        """Draw a random batch: points (count, 2) and occupancies (count,)."""
        chosen = torch.randint(len(self.points), (count,), generator=self._generator)
        return self.points[chosen], self.inside[chosen]


def occupancy_loss(
    model: TileModel, points: Tensor, inside: Tensor, hardness: float, *, affine: bool = False
) -> Tensor:
    """Return the mean binary cross-entropy of sigmoid(tau phi(D^-1 q)) and o(q), one a candidate.

    phi is the signed distance to the template, rescaled to the target's units, tau the `hardness`
    (paper, equation of L). The points (N, 2) are in the target's normal form, `inside` (N,) is 0 or
    1, and `affine` leaves the flow out.
    """
    pulled = model.unplace(points) if affine else model.inverse(points)
    phi = signed_distance(pulled, model.template()) * model.log_scale.exp()[:, None]
    goal = torch.as_tensor(inside, dtype=phi.dtype).expand_as(phi)
    return F.binary_cross_entropy_with_logits(hardness * phi, goal, reduction="none").mean(dim=-1)


def fit_occupancy(
    target: Target,
    kind: IsohedralClass | str,
    settings: OccupancySearch,
    progress: OnProgress = silent,
    *,
    cancel: Cancel = NEVER,
) -> TileModel:
    """Fit tiles of one class to a target by the paper's method, all starts side by side.

    Returns the surviving candidates, best loss first. They are not certified yet.
    """
    kind = isohedral_class(kind)
    as_instance(target, Target, "the target", "Target.read and Target.from_polygon make one")
    as_instance(settings, SearchMethod, "settings", "give an OccupancySearch")
    # the mean over the candidates is all that couples them: separate fits, one tensor
    samples = OccupancySamples(target, 16384, seed=settings.seed)
    angles, mirrored = initial_poses(kind, settings.turns)
    model = TileModel(
        kind,
        angles,
        mirrored=mirrored,
        max_frequency=settings.max_frequency,
        segments=settings.segments,
        smoothness=settings.smoothness,
        steps=settings.steps,
        method=settings.method,
        dtype=torch.float32,
    )
    model = _affine_phase(model, samples, settings, cancel)
    third = max(1, settings.iterations // 3)

    def report(share: float, loss: float) -> None:
        progress(share, loss)
        cancel.check()

    model = _flow_phase(model, samples, settings, 0, third, report)
    if model.size > 1:
        model = _ranked(model, samples, settings.hardness[1], keep=(model.size + 1) // 2)
    model = _flow_phase(model, samples, settings, third, settings.iterations, report)
    return _ranked(model, samples, settings.hardness[1], keep=model.size)


def _pose(model: TileModel) -> list[torch.nn.Parameter]:
    return [model.angle, model.log_scale, model.offset, model.shape, model.stretch]


def _affine_phase(
    model: TileModel, samples: OccupancySamples, settings: OccupancySearch, cancel: Cancel
) -> TileModel:
    adam = Adam(_pose(model))
    for _ in range(settings.affine_iterations):
        cancel.check()
        points, inside = samples.draw(512)
        loss = occupancy_loss(model, points, inside, 15.0, affine=True)
        bent = SHAPE_PENALTY * model.shape.square().sum(dim=-1)
        adam.step((loss + bent).sum(), rate=0.03)
    ranked = _ranked(model, samples, 15.0, keep=model.size, affine=True)
    return ranked.take(_distinct(ranked, settings.finalists))


@torch.no_grad()
def _distinct(model: TileModel, count: int) -> list[int]:
    """Return the first `count` candidates whose placed templates differ: many end in one pose."""
    order, _ = template_symmetries(model.isohedral_class)
    placed = model.place(model.template())
    sides = placed.shape[1]
    chosen: list[int] = []
    for i in range(model.size):
        shifts = [placed[i].roll(k * sides // order, dims=0) for k in range(order)]
        nearest = [
            float(linalg.vector_norm(shift - placed[j], dim=-1).max())
            for shift in shifts
            for j in chosen
        ]
        if min(nearest, default=math.inf) > 0.1:
            chosen.append(i)
    return chosen[:count]


def _flow_phase(
    model: TileModel,
    samples: OccupancySamples,
    settings: OccupancySearch,
    begin: int,
    end: int,
    report: OnProgress,
) -> TileModel:
    pose, flow = _pose(model), list(model.flow.parameters())
    peaks = [settings.learning_rate / 2] * len(pose) + [settings.learning_rate] * len(flow)
    adam = Adam(pose + flow)
    for i in range(begin, end):
        done = i / settings.iterations
        warm, fall = min(1.0, (i - begin + 1) / 10), 0.51 + 0.49 * math.cos(math.pi * done)
        points, inside = samples.draw(settings.points)
        loss = occupancy_loss(model, points, inside, between(settings.hardness, done))
        squares = [p.square().sum(dim=-1) for p in flow]
        energy = between(settings.penalty, done) * torch.stack(squares).sum(dim=0)
        bent = SHAPE_PENALTY * model.shape.square().sum(dim=-1)
        adam.step((loss + energy + bent).sum(), [peak * warm * fall for peak in peaks])
        report((i + 1) / settings.iterations, float(loss.detach().min()))
    return model


@torch.no_grad()
def _ranked(
    model: TileModel, samples: OccupancySamples, hardness: float, *, keep: int, affine: bool = False
) -> TileModel:
    points, inside = samples.points[::4], samples.inside[::4]
    loss = occupancy_loss(model, points, inside, hardness, affine=affine)
    return model.take(listed(loss.argsort(stable=True)[:keep]))
