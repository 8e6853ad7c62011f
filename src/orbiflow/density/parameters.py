"""Parameters of an estimator by name, as scikit-learn asks for them."""

from __future__ import annotations

import inspect
from collections.abc import Iterable
from typing import Any, Self

from orbiflow.errors import OrbiflowError


class Parameters:
    """What scikit-learn asks of an estimator whose constructor keeps its arguments as they are."""

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        """The constructor's arguments, by name."""
        del deep
        return {name: getattr(self, name) for name in self._names()}

    def set_params(self, **params: Any) -> Self:
        """Change constructor arguments.

        Raises:
            OrbiflowError: for a name that is none.
        """
        for name, value in params.items():
            if name not in self._names():
                raise OrbiflowError(f"no parameter {name!r}; there are {', '.join(self._names())}")
            setattr(self, name, value)
        return self

    def __sklearn_tags__(self) -> Any:
        # asked for by scikit-learn alone, which is therefore there
        from sklearn.utils import Tags, TargetTags  # pyright: ignore[reportMissingImports, reportMissingTypeStubs]

        return Tags(
            estimator_type="density_estimator",
            target_tags=TargetTags(required=False),
            transformer_tags=None,
            regressor_tags=None,
            classifier_tags=None,
        )

    def __repr__(self) -> str:
        shown = [f"{name}={value!r}" for name, value in self._changed(self._names()).items()]
        return f"{type(self).__name__}({', '.join(shown)})"

    @classmethod
    def _names(cls) -> list[str]:
        return list(inspect.signature(cls).parameters)

    def _changed(self, names: Iterable[str]) -> dict[str, Any]:
        """Parameters that are not at their defaults."""
        defaults = inspect.signature(type(self)).parameters
        given = {name: getattr(self, name) for name in names}
        return {name: v for name, v in given.items() if v != defaults[name].default}
