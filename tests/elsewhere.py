"""A device for tests on machines that have none: tensors say that they are on "meta", and compute.

Whatever a real device refuses is refused: operations on tensors of both places, `numpy()` of its own.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import torch
from torch import Tensor
from torch.overrides import TorchFunctionMode
from torch.utils._python_dispatch import TorchDispatchMode
from torch.utils._pytree import tree_flatten, tree_map

DEVICE = torch.device("meta")


class Elsewhere(Tensor):
    """What is there; `here` is its content."""

    here: Tensor

    @staticmethod
    def __new__(cls, here: Tensor) -> Elsewhere:
        made = Tensor._make_wrapper_subclass(
            cls,
            here.size(),
            strides=here.stride(),
            storage_offset=here.storage_offset(),
            dtype=here.dtype,
            device=DEVICE,
        )
        made.here = here
        return made

    @classmethod
    def __torch_dispatch__(cls, func: Any, _types: Any, args: Any = (), kwargs: Any = None) -> Any:
        return _run(func, args, kwargs or {})

    def new_tensor(self, data: Any, **_options: Any) -> Tensor:
        return Elsewhere(self.here.new_tensor(data))

    def __repr__(self, **_options: Any) -> str:  # type: ignore[override]
        return f"Elsewhere({self.here!r})"


@contextmanager
def a_device() -> Iterator[torch.device]:
    """In its block, tensors can be moved to the device that it gives, made and worked on there."""
    with _Making(), _Working():
        yield DEVICE


class _Making(TorchFunctionMode):
    """Tensors of plain numbers: what `_Working` sees of them is already made."""

    def __torch_function__(self, func: Any, _types: Any, args: Any = (), kwargs: Any = None) -> Any:
        options = dict(kwargs or {})
        if func in (torch.tensor, torch.as_tensor) and options.get("device") == DEVICE:
            del options["device"]
            return func(*args, **options).to(DEVICE)
        return func(*args, **options)


class _Working(TorchDispatchMode):
    def __torch_dispatch__(self, func: Any, _types: Any, args: Any = (), kwargs: Any = None) -> Any:
        return _run(func, args, kwargs or {})


def _run(func: Any, args: Any, kwargs: dict[str, Any]) -> Any:
    wanted = kwargs.get("device")
    tensors = [t for t in tree_flatten((args, kwargs))[0] if isinstance(t, Tensor)]
    there = [t for t in tensors if isinstance(t, Elsewhere)]
    moving = func in (torch.ops.aten._to_copy.default, torch.ops.aten.copy_.default)
    indexing = func.__name__.startswith(("index.", "index_put", "_unsafe_index"))
    if there and not moving and not indexing:
        for t in tensors:
            # numbers may be anywhere
            if not isinstance(t, Elsewhere) and t.dim():
                raise RuntimeError(f"{func}: tensors on two devices")
    inside = {**kwargs, "device": torch.device("cpu")} if wanted is not None else kwargs
    args, inside = tree_map(lambda t: t.here if isinstance(t, Elsewhere) else t, (args, inside))
    found = func(*args, **inside)
    made_there = torch.device(wanted) == DEVICE if wanted is not None else bool(there)
    if not made_there:
        return found
    if func._schema.is_mutable and there:
        # an operation in place gives back what it was given
        return there[0] if isinstance(found, Tensor) else found
    return tree_map(_wrapped, found)


def _wrapped(found: Any) -> Any:
    # a wrapper does not show that its content is to be read as conjugate
    return Elsewhere(found.resolve_conj().resolve_neg()) if isinstance(found, Tensor) else found
