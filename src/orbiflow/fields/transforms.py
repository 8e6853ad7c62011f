"""Hand-written derivatives under the transforms of torch.

Autograd functions with hand-written derivatives evaluate a field. Under `torch.func` ordinary
operations compute the same sums: nested forward mode (`jacfwd` of `jacfwd`) through an autograd
function is silently wrong in torch 2.13, even if the function has its own rules.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import torch
from torch import Tensor
from torch.autograd import forward_ad

from orbiflow.errors import OrbiflowError

# torch uses these itself, but has neither public names nor types for them
_core: Any = torch._C  # pyright: ignore[reportPrivateUsage]
_forward_mode: Any = forward_ad


def transformed() -> bool:
    """Return whether `torch.func` (vmap, grad, jvp and what builds on them) or forward mode is active.

    Tensors may then stand for batches, or carry tangents. torch has no public function for this; its
    own autograd functions ask the same.
    """
    return _core._are_functorch_transforms_active() or _forward_mode._current_level >= 0


def plain_gradients(
    function: Callable[..., Any], inputs: tuple[Tensor, ...], ctx: Any, cotangents: Any
) -> list[Tensor | None]:
    """Return the gradients of `function`, written in ordinary operations, for a backward pass.

    They can be differentiated in any mode and batched; None for inputs that need no gradient.
    """
    needed = ctx.needs_input_grad[: len(inputs)]
    if not transformed():
        # views, because one input may depend on another: the gradient would follow that path here
        # and again in the outer pass
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
    """Refuse gradients that torch's older vectorization has batched.

    Raises:
        OrbiflowError: for such gradients, which autograd functions do not support.
    """
    if any(_core._functorch.is_legacy_batchedtensor(gradient) for gradient in gradients):
        raise OrbiflowError(
            "a field cannot be differentiated with vectorize=True or is_grads_batched=True: "
            "torch.func.vmap(torch.func.jacrev(field))(points) gives its Jacobians"
        )
