"""A network on periodic features, made symmetric: a field of somebody's own."""

import itertools

import torch
from torch import nn

from orbiflow.fields import PeriodicFeatures, Symmetrized, symmetrize


@torch.inference_mode(False)  # its divergence is taken by autograd
def neural_field(
    group, *, hidden=(64, 64), max_frequency=1, seed=0, dtype=torch.float64
) -> Symmetrized:
    """A symmetrized perceptron whose last layer is zero; the global random state does not change."""
    features = PeriodicFeatures(group, max_frequency)
    sizes = (features.size, *hidden, group.dim)
    layers: list[nn.Module] = [features]
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        for a, b in itertools.pairwise(sizes):
            layers += [nn.Linear(a, b, dtype=dtype), nn.Tanh()]
    for parameter in layers[-2].parameters():
        nn.init.zeros_(parameter)
    return symmetrize(nn.Sequential(*layers[:-1]), group, periodic=True)
