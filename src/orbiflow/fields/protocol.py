"""The protocol of vector fields, and their derivatives.

A field is any callable from points (..., d) to vectors of the same shape: a function, a lambda, a torch
module. Nothing else is required. What else it offers is found by name; a method of one of these names
must do what is described here. `jacobian` returns dV_i / dp_j (..., d, d), `divergence` (...,), and
`lipschitz_bound` an upper bound of the Jacobian's spectral norm anywhere, () or (S,), or None.

| the field has | then |
|---|---|
| `jacobian(points)`, `divergence(points)` | closed forms are used in place of autograd |
| `bound()` | what depends only on the parameters is computed once for many evaluations |
| `bound_with_divergence()` | V and its divergence come from shared work |
| `bound_with_jacobian()` | V and its Jacobian come from shared work |
| `lipschitz_bound()` | the accuracy of integration steps is judged without trying them |

Built-in fields are evaluated by autograd functions with hand-written derivatives. Under `torch.func`
ordinary operations compute the same sums: nested forward mode (`jacfwd` of `jacfwd`) through an
autograd function is silently wrong in torch 2.13, even if the function has its own rules.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

import torch
from torch import Tensor, nn

from orbiflow.errors import OrbiflowError
from orbiflow.fields.layers import bound_of_layers
from orbiflow.typed_torch import is_old_batch, transformed

VectorField = Callable[[Tensor], Tensor]
"""A map from points (..., d) to vectors (..., d)."""


def jacobian(field: VectorField, points: Tensor) -> Tensor:
    """Return dV_i / dp_j at points (..., d), as (..., d, d): exact, d backward passes."""
    method: Any = getattr(field, "jacobian", None)
    return method(points) if method else _by_autograd(field, points)[1]


def divergence(field: VectorField, points: Tensor) -> Tensor:
    """Return the trace of the Jacobian at points (..., d), as (...,): exact."""
    method: Any = getattr(field, "divergence", None)
    return method(points) if method else _trace(jacobian(field, points))


def prepared(field: VectorField) -> VectorField:
    """Return the field as a function for many evaluations at fixed parameters."""
    method: Any = getattr(field, "bound", None)
    return method() if method else partial(_values, field)


def prepared_with_divergence(field: VectorField) -> Callable[[Tensor], tuple[Tensor, Tensor]]:
    """Return, as `prepared` does, a function for V and its divergence, sharing work if possible."""
    method: Any = getattr(field, "bound_with_divergence", None)
    if method:
        return method()
    if hasattr(field, "divergence"):
        return lambda points: (_values(field, points), divergence(field, points.clone()))
    joint = prepared_with_jacobian(field)

    def both(points: Tensor) -> tuple[Tensor, Tensor]:
        values, slopes = joint(points)
        return values, _trace(slopes)

    return both


def prepared_with_jacobian(field: VectorField) -> Callable[[Tensor], tuple[Tensor, Tensor]]:
    """Return, as `prepared` does, a function for V and its Jacobian, sharing work if possible."""
    method: Any = getattr(field, "bound_with_jacobian", None)
    if method:
        return method()
    if hasattr(field, "jacobian"):
        return lambda points: (_values(field, points), jacobian(field, points.clone()))
    return lambda points: _by_autograd(field, points)


def lipschitz_bound(field: object) -> float | None:
    """Return the field's own bound of its Jacobian's spectral norm, that of its layers, or None."""
    method: Any = getattr(field, "lipschitz_bound", None)
    if method is None:
        return bound_of_layers(field, lipschitz_bound)
    bound = method()
    return None if bound is None else float(bound.max())


def _values(field: VectorField, points: Tensor) -> Tensor:
    """Return a field of the user's at points, of which it gets a copy: it may write into it."""
    return field(points.clone())


def _trace(slopes: Tensor) -> Tensor:
    return slopes.diagonal(dim1=-2, dim2=-1).sum(dim=-1)


def _by_autograd(field: VectorField, points: Tensor) -> tuple[Tensor, Tensor]:
    """Return V and its Jacobian, differentiable in the points and in what the field holds."""
    if transformed():
        return _functionally(field, points)
    keep = torch.is_grad_enabled() and _is_differentiable(field, points)
    # inference mode would forbid derivatives even here
    with torch.inference_mode(False), torch.enable_grad():
        inputs = points.clone() if points.is_inference() else points
        inputs = inputs if inputs.requires_grad else inputs.detach().requires_grad_()
        values = _values(field, inputs)
        if not values.requires_grad:  # a constant field
            return values, points.new_zeros(*points.shape, points.shape[-1])
        options: Any = {"create_graph": keep, "retain_graph": True, "materialize_grads": True}
        sums = [values[..., i].sum() for i in range(points.shape[-1])]
        rows = [torch.autograd.grad(total, inputs, **options)[0] for total in sums]
    return values if keep else values.detach(), torch.stack(rows, dim=-2)


def _functionally(field: VectorField, points: Tensor) -> tuple[Tensor, Tensor]:
    """Return V and its Jacobian under `torch.func`, where requires_grad cannot be set."""
    values, pull, *_ = torch.func.vjp(partial(_values, field), points)
    units = torch.eye(points.shape[-1], dtype=points.dtype, device=points.device)
    rows = [pull(unit.expand(points.shape))[0] for unit in units]
    return values, torch.stack(rows, dim=-2)


def _is_differentiable(field: VectorField, points: Tensor) -> bool:
    if points.requires_grad:
        return True
    if isinstance(field, nn.Module) and any(p.requires_grad for p in field.parameters()):
        return True
    # a plain function may use parameters that show only in its values
    return _values(field, points).requires_grad


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
        rest = iter(wanted)
        return function(*(next(rest) if n else t for n, t in zip(needed, inputs, strict=True)))

    wanted = [t for n, t in zip(needed, inputs, strict=True) if n]
    pulled = iter(torch.func.vjp(of_wanted, *wanted)[1](cotangents))
    return [next(pulled) if n else None for n in needed]


def refuse_old_batches(*gradients: Tensor) -> None:
    """Refuse gradients that torch's older vectorization has batched."""
    if any(map(is_old_batch, gradients)):
        raise OrbiflowError(
            "a field cannot be differentiated with vectorize=True or is_grads_batched=True: "
            "torch.func.vmap(torch.func.jacrev(field))(points) gives its Jacobians"
        )
