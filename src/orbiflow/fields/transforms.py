"""Whether torch transforms what is being computed, and what hand-written derivatives do then.

A field is evaluated by autograd functions with derivatives written by hand. `torch.func` gets the same
sums by ordinary operations instead: nested forward mode (`jacfwd` of `jacfwd`) through an autograd
function is silently wrong in torch 2.13, even where it has its own rules.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import torch
from torch import Tensor
from torch.autograd import forward_ad

from orbiflow.errors import OrbiflowError

# torch asks them itself, and has neither a public name nor types for them
_core: Any = torch._C  # pyright: ignore[reportPrivateUsage]
_forward_mode: Any = forward_ad


def transformed() -> bool:
    """Return whether `torch.func` (vmap, grad, jvp and what builds on them) or forward mode is active.

    Tensors may then stand for many, or carry tangents. torch has no public word for this; its own
    autograd functions ask the same.
    """
    return _core._are_functorch_transforms_active() or _forward_mode._current_level >= 0


def plain_gradients(
    function: Callable[..., Any], inputs: tuple[Tensor, ...], ctx: Any, cotangents: Any
) -> list[Tensor | None]:
    """Return the backward pass of an autograd function that is `function` by ordinary operations.

    May itself be differentiated, in any mode, and batched; None for inputs that need no gradient.
    """
    needed = ctx.needs_input_grad[: len(inputs)]
    if not transformed():
        # views: were one input to depend on another, a gradient with respect to that one would also
        # follow that path, which the outer pass follows as well
        inputs = tuple(t.view_as(t) for t in inputs)
        chosen = [t for n, t in zip(needed, inputs, strict=True) if n]
        values = function(*inputs)
        gradients = iter(torch.autograd.grad(values, chosen, cotangents, create_graph=True))
        return [next(gradients) if n else None for n in needed]

    def of_wanted(*wanted: Tensor) -> Any:
        given = iter(wanted)
        return function(*(next(given) if n else t for n, t in zip(needed, inputs, strict=True)))

    wanted = [t for n, t in zip(needed, inputs, strict=True) if n]
    found = iter(torch.func.vjp(of_wanted, *wanted)[1](cotangents))
    return [next(found) if n else None for n in needed]


def refuse_old_batches(*gradients: Tensor) -> None:
    """
    Raises:
        OrbiflowError: for gradients batched by torch's older means, which know no autograd functions.
    """
    if any(_core._functorch.is_legacy_batchedtensor(gradient) for gradient in gradients):
        raise OrbiflowError(
            "a field cannot be differentiated with vectorize=True or is_grads_batched=True: "
            "torch.func.vmap(torch.func.jacrev(field))(points) gives its Jacobians"
        )
