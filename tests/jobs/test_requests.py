"""Requests go to JSON and back, and what cannot be used is refused by its name."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import fields
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from orbiflow.errors import OrbiflowError
from orbiflow.jobs import (
    BatchRequest,
    DensityBatchRequest,
    DensityCompareRequest,
    DensityCvRequest,
    DensityFitRequest,
    DensityPlotRequest,
    DensityRegionRequest,
    EscherizeRequest,
    PatchesRequest,
    RecordError,
    Request,
    density_requests,
)
from orbiflow.jobs.density_cv_requests import DensityFoldRequest
from orbiflow.jobs.requests import request_from_json

names = st.text(st.characters(exclude_characters="\0"), min_size=1)
paths = names.map(Path)
columns = st.none() | st.lists(st.text(), min_size=1).map(tuple)
seeds = st.integers(0, 2**32 - 1)
numbers = st.floats(0, 1e300)
units = st.sampled_from(["radians", "degrees", "turns"])
measures = st.sampled_from(["natural", "square", "uniform"])
spaces = st.sampled_from(["torus", "sphere", "klein-bottle", "projective-plane"])

REQUESTS = st.one_of(
    st.builds(
        EscherizeRequest,
        image=paths,
        out=paths,
        classes=st.none() | st.lists(st.text()).map(tuple),
        effort=st.sampled_from([None, "fast", "normal", "best"]),
        objective=st.sampled_from(["overlap", "both"]),
        min_neck=st.none() | st.floats(0, 0.2),
        emphasis=paths,
        strength=st.none() | numbers,
        per_class=st.integers(1),
        max_frequency=st.none() | st.integers(),
        seed=st.integers(),
        workers=st.none() | st.integers(1),
        threshold=st.none() | st.floats(0, 1),
        invert=st.none() | st.booleans(),
        force=st.booleans(),
        called=st.none() | st.text(),
    ),
    st.builds(
        EscherizeRequest,
        image=paths,
        objective=st.sampled_from([None, "likeness", "both"]),
        pin=st.lists(st.text(), min_size=1).map(tuple),
        pin_angle=st.booleans(),
    ),
    st.builds(
        EscherizeRequest,
        image=paths,
        method=st.just("occupancy"),
        turns=st.none() | st.integers(),
        iterations=st.none() | st.integers(),
    ),
    st.builds(
        DensityFitRequest,
        data=paths,
        space=spaces,
        columns=columns,
        unit=units,
        parts=st.none() | st.lists(st.sampled_from(density_requests.PARTS), min_size=1).map(tuple),
        repeats=st.sampled_from(["places", "rounding"]),
        detail=st.none() | st.integers(),
        seconds=st.none() | numbers,
        seed=seeds,
    ),
    st.builds(
        DensityPlotRequest,
        model=paths,
        data=st.none() | paths,
        coastlines=st.none() | paths,
        center=st.none() | st.text(),
        scale=st.sampled_from(["auto", "linear", "log"]),
        dots=st.booleans(),
    ),
    st.builds(
        DensityCompareRequest,
        data=paths.map(lambda path: (path,)),
        models=st.lists(paths, min_size=2, unique=True).map(tuple),
        columns=columns,
        group=st.none() | st.text(),
        bootstrap=st.integers(100, 10**6),
        level=st.floats(0.5, 0.999),
        seed=seeds,
    ),
    st.builds(
        DensityCompareRequest, data=st.tuples(paths, paths), space=spaces, unit=st.none() | units
    ),
    st.builds(
        DensityRegionRequest,
        model=paths,
        out=st.sampled_from(["a.geojson", "b.JSON", "c.csv"]).map(Path),
        mass=st.none() | st.lists(st.floats(0.01, 0.99), min_size=1, max_size=9).map(tuple),
        level=st.none() | st.lists(st.floats(-99, 99), min_size=1, max_size=9).map(tuple),
        samples=st.integers(1000, 10**7),
        seed=seeds,
    ),
    st.builds(
        BatchRequest,
        folder=paths,
        out=paths,
        each=st.fixed_dictionaries(
            {"effort": st.sampled_from([None, "fast"]), "classes": st.none() | st.lists(st.text())}
        ),
        match=st.none() | st.just("*.svg"),
        workers=st.none() | st.integers(1),
        retry_failed=st.booleans(),
    ),
    st.builds(
        DensityBatchRequest,
        folder=paths,
        each=st.fixed_dictionaries({"space": spaces, "seed": seeds}),
        scheduler=st.none() | st.just("tcp://127.0.0.1:8786"),
    ),
    st.builds(PatchesRequest, data=paths, columns=columns, unit=units, farthest=numbers),
)


@given(REQUESTS)
def test_to_json_and_back(request_: Request) -> None:
    text = json.dumps(request_.to_json(), allow_nan=False)
    assert request_from_json(json.loads(text)) == request_


def test_numbers_of_numpy_and_paths_as_text_are_plain() -> None:
    import numpy as np

    request = EscherizeRequest(
        image="cat.png",  # type: ignore[arg-type]
        classes=["IH4"],  # type: ignore[arg-type]
        workers=np.int64(3),  # type: ignore[arg-type]
        threshold=np.float32(0.5),  # type: ignore[arg-type]
    )
    assert request == EscherizeRequest(Path("cat.png"), classes=("IH4",), workers=3, threshold=0.5)
    assert type(request.workers) is int
    assert type(request.threshold) is float


GOOD: dict[str, Any] = {"schema_version": 1, "kind": "escherize", "image": "cat.png"}

MISTAKES: dict[str, tuple[Any, str]] = {
    "a list": ([1, 2], "a request is a JSON object, got [1, 2]"),
    "no kind": ({"schema_version": 1}, "unknown kind None of request; there are escherize, "),
    "odd kind": ({**GOOD, "kind": ["escherize"]}, "unknown kind ['escherize'] of request"),
    "an event": ({**GOOD, "kind": "note"}, "unknown kind 'note' of request"),
    "version": ({**GOOD, "schema_version": 2}, "a request has schema_version 1, got 2"),
    "no version": ({"kind": "escherize", "image": "a"}, "schema_version 1, got None"),
    "unknown": ({**GOOD, "clases": "all"}, "unknown field 'clases' of escherize; there are image,"),
    "missing": ({"schema_version": 1, "kind": "escherize"}, "escherize lacks a field: image"),
    "text": ({**GOOD, "workers": "2"}, "workers must be a whole number or nothing, got '2'"),
    "fraction": ({**GOOD, "workers": 2.5}, "workers must be a whole number or nothing, got 2.5"),
    "truth": ({**GOOD, "workers": True}, "workers must be a whole number or nothing, got True"),
    "number": ({**GOOD, "force": 1}, "force must be true or false, got 1"),
    "a string as a list": ({**GOOD, "classes": "IH4"}, "classes must be a list, each entry text"),
    "numbers in a list": ({**GOOD, "classes": [4]}, "classes must be a list, each entry text"),
    "choice": ({**GOOD, "effort": "heroic"}, "effort must be fast, normal or best or nothing"),
    "no path": ({**GOOD, "image": ""}, "image must be a path, got ''"),
    "null byte": ({**GOOD, "image": "a\0b"}, "image must be a path"),
    "null": ({**GOOD, "out": None}, "out must be a path, got None"),
    "infinite": ({**GOOD, "emphasis": "m", "strength": float("inf")}, "strength must be finite"),
    "range": ({**GOOD, "per_class": 0}, "per_class must be at least 1, got 0"),
    "no pins": ({**GOOD, "pin": []}, "pin names no part; give x,y or x,y,radius, or a mask"),
    "a pin as text": ({**GOOD, "pin": "9,9"}, "pin must be a list, each entry text or nothing"),
    "an angle alone": ({**GOOD, "pin_angle": True}, "pin_angle needs pin"),
    "pins of overlap": (
        {**GOOD, "pin": ["9,9"], "objective": "overlap"},
        "pin belongs to objective",
    ),
    "two fields": ({**GOOD, "strength": 2.0}, "strength needs emphasis: the mask"),
    "deep": (
        {**GOOD, "image": {"path": "cat.png"}},
        "image must be a path, got {'path': 'cat.png'}",
    ),
}


@pytest.mark.parametrize("case", MISTAKES)
def test_mistakes(case: str) -> None:
    document, message = MISTAKES[case]
    with pytest.raises(RecordError) as caught:
        request_from_json(document)
    assert message in str(caught.value)
    assert isinstance(caught.value, OrbiflowError)


def test_a_message_can_name_fields_as_its_reader_does() -> None:
    with pytest.raises(RecordError) as caught:
        EscherizeRequest(Path("cat.png"), turns=3)
    assert str(caught.value).startswith("turns belongs to method occupancy")
    assert caught.value.named(str.upper).startswith("TURNS belongs to METHOD occupancy")


def test_no_numerical_library_is_imported() -> None:
    code = "import sys, orbiflow.jobs; sys.exit(bool({'torch', 'numpy'} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_a_fit_has_every_field_that_its_request_shares_with_it() -> None:
    own: dict[str, Any] = {
        "data": Path("a.csv"), "space": "klein-bottle", "out": Path("b"), "columns": ("x", "y"),
        "header": False, "missing": "drop", "weights": "w", "unit": "degrees", "parts": ("kernels",),
        "repeats": "rounding", "seed": 7,
    }  # fmt: skip
    cases = (
        (DensityFoldRequest, DensityFoldRequest(fold=1, group="g", **own).fit(), {"group": "g"}),
        # groups make the folds of a cross-validation; its fits of a flow alone would refuse them
        (
            DensityCvRequest,
            DensityCvRequest(group="g", drop_missing=True, **own).whole_fit(),
            {"group": None, "drop_missing": True},
        ),
    )
    for kind, fit, more in cases:
        expected = own | more
        assert {f.name for f in fields(kind)} & {f.name for f in fields(fit)} == set(expected)
        assert {name: getattr(fit, name) for name in expected} == expected
