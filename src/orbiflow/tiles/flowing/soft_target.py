"""A target as an image of signed distances, for the soft occupancy of thousands of points."""

from functools import cached_property

import numpy as np
import shapely
import torch
import torch.nn.functional as F
from scipy.ndimage import distance_transform_edt
from torch import Tensor

from orbiflow.errors import OrbiflowError
from orbiflow.settings import as_instance, as_number, as_whole
from orbiflow.tiles.silhouette import Emphasis, Target

MARGIN = 0.5  # around the target's bounding box, in square roots of its area
PIECES_PER_SIDE = 8  # the number of pieces of each side of a ring in integrals along it


class SoftTarget:
    """The signed distance of a target on a square grid, positive inside, in its normal form.

    Args:
        target: The silhouette.
        resolution: The number of pixels along a side.
        emphasis: The weights of the plane's points, if some matter more than others.
    """

    def __init__(
        self, target: Target, *, resolution: int = 512, emphasis: Emphasis | None = None
    ) -> None:
        as_instance(target, Target, "the target", "Target.read and Target.from_polygon make one")
        resolution = as_whole(resolution, "resolution", 2)
        low, high = target.normal.min(axis=0) - MARGIN, target.normal.max(axis=0) + MARGIN
        center, self.reach = (low + high) / 2, float((high - low).max() / 2)
        axis = self.reach * ((np.arange(resolution) + 0.5) / resolution * 2 - 1)
        x, y = np.meshgrid(float(center[0]) + axis, float(center[1]) + axis)
        region = shapely.Polygon(target.normal)
        shapely.prepare(region)
        inside = shapely.contains_xy(region, x.ravel(), y.ravel()).reshape(x.shape)
        # half a pixel: the boundary runs between pixel centres
        steps = np.where(
            inside,
            np.asarray(distance_transform_edt(inside)) - 0.5,
            0.5 - np.asarray(distance_transform_edt(~inside)),
        )
        pixel = 2 * self.reach / resolution
        self.center = torch.tensor(center, dtype=torch.float32)
        self.image = torch.tensor(steps * pixel, dtype=torch.float32)[None, None]
        self.weights: Tensor | None = None
        if emphasis is not None:
            weights = emphasis.weight(np.stack([x, y], axis=-1))
            self.weights = torch.tensor(weights, dtype=torch.float32)[None, None]

    def occupancy(self, points: Tensor, blur: float) -> Tensor:
        """Return the soft occupancy, 0 to 1, at points (..., 2): a sigmoid of distance over `blur`."""
        blur = as_number(blur, "blur", above=0)
        return torch.sigmoid(self._sample(self.image, points) * (1.7 / blur))

    def weight(self, points: Tensor) -> Tensor:
        """Return the weights of points (..., 2), 1 without emphasis."""
        if self.weights is None:
            return torch.ones_like(points[..., 0])
        return self._sample(self.weights, points)

    def weighted_iou(self, rings: Tensor) -> Tensor:
        """Return the IoU (S,) of counter-clockwise rings (S, N, 2) with the target, weighted.

        The areas are weighted by the emphasis. By Green's theorem they are integrals over the rings
        of the weights' integral along x, accurate to a pixel of the image.
        """
        whole, common, total = self._integrals
        sides = (rings.roll(-1, dims=1) - rings)[:, :, None]
        shares = (torch.arange(PIECES_PER_SIDE, dtype=rings.dtype)[:, None] + 0.5) / PIECES_PER_SIDE
        middle = rings[:, :, None] + shares * sides
        rise = sides[..., 1] / PIECES_PER_SIDE
        area, shared = (
            (self._sample(image, middle) * rise).sum(dim=(1, 2)) for image in (whole, common)
        )
        return shared / (area + total - shared)

    @cached_property
    def _integrals(self) -> tuple[Tensor, Tensor, float]:
        weights = torch.ones_like(self.image) if self.weights is None else self.weights
        pixel = 2 * self.reach / self.image.shape[-1]
        inside = (self.image > 0).to(weights.dtype) * weights
        whole, common = (
            ((torch.cumsum(w, dim=-1, dtype=torch.float64) - 0.5 * w) * pixel).to(w.dtype)
            for w in (weights, inside)
        )
        return whole, common, float(inside.double().sum()) * pixel**2

    def _sample(self, image: Tensor, points: Tensor) -> Tensor:
        points = torch.as_tensor(points, dtype=image.dtype)
        grid = ((points - self.center) / self.reach).reshape(1, 1, -1, 2)
        values = F.grid_sample(image, grid, align_corners=False, padding_mode="border")
        return values.reshape(points.shape[:-1])


def signed_distance(points: Tensor, vertices: Tensor) -> Tensor:
    """Return the true distance to the boundary, positive inside (paper, equation of phi).

    Of points (..., N, 2) to simple polygons `vertices` (..., K, 2), in either orientation; leading
    axes broadcast. Gradients are unit vectors except on the boundary and the medial axis.

    >>> square = torch.tensor([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]])
    >>> signed_distance(torch.tensor([[1.0, 0.5], [3.0, 3.0]]), square).tolist()
    [0.5, -1.4142135381698608]
    """
    for name, tensor in (("points", points), ("vertices", vertices)):
        as_instance(tensor, Tensor, name, "torch.as_tensor makes one of an array")
        if not tensor.is_floating_point() or tensor.ndim < 2 or tensor.shape[-1] != 2:
            raise OrbiflowError(
                f"{name} must be floating-point numbers of shape (..., N, 2), got "
                f"{tensor.dtype} of shape {tuple(tensor.shape)}"
            )
    start = vertices.unsqueeze(-3)  # (..., 1, K, 2)
    edge = vertices.roll(-1, dims=-2).unsqueeze(-3) - start
    offset = points.unsqueeze(-2) - start  # (..., N, K, 2)
    length = edge.square().sum(dim=-1).clamp_min(torch.finfo(points.dtype).tiny)
    along = ((offset * edge).sum(dim=-1) / length).clamp(0.0, 1.0)
    squared = (offset - along.unsqueeze(-1) * edge).square().sum(dim=-1).amin(dim=-1)
    # keeps the gradient finite for a point on the boundary
    distance = squared.clamp_min(torch.finfo(points.dtype).eps ** 2).sqrt()
    # inside by the crossings of a ray to the right (even-odd rule)
    y, height = offset[..., 1].detach(), edge[..., 1].detach()
    straddles = (y >= 0) != (y >= height)
    cross = edge[..., 0].detach() * y - height * offset[..., 0].detach()
    right = (cross > 0) == (height > 0)
    inside = (straddles & right).sum(dim=-1) % 2 == 1
    return torch.where(inside, distance, -distance)
