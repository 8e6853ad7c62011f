"""Saved densities as commands ask them: their columns, the tables that suit them, what is known."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from orbiflow.density import data, inference, pictures, tables
from orbiflow.density.models import ConditionalDensity, Density, read_density
from orbiflow.errors import InputFileError, SettingError, literal
from orbiflow.runtime import Note, Sink, ignore

if TYPE_CHECKING:
    from orbiflow.density.spaces import Covariate, Values


@dataclass(frozen=True)
class SavedDensity:
    """A density that was read, what its columns are called, and what else was saved with it.

    - `at`: The covariates, by name, at which it is the density.
    """

    path: Path
    density: Density
    columns: tuple[str, ...]
    extra: Mapping[str, Any]
    at: Mapping[str, Any]

    @classmethod
    def read(cls, path: Path) -> SavedDensity:
        """Read the density in a file or in the folder of a fit."""
        file = path / pictures.MODEL if path.is_dir() else path
        if not file.exists():
            what = f"{pictures.MODEL} in it" if path.is_dir() else "such folder"
            raise InputFileError(
                f"cannot read {path}: there is no {what}; give the folder that `orbiflow density fit` "
                "wrote"
            )
        density, extra = read_density(file)
        names = tuple(str(name) for name in extra.get("columns") or ())
        there = density.space.columns
        return cls(path, density, names if len(names) == len(there) else there, extra, {})

    @classmethod
    def read_at(cls, path: Path, texts: Sequence[str], tell: Sink) -> SavedDensity:
        """Read the density where all covariates are as texts such as temperature=295 say."""
        saved, others = cls.read(path).split(texts, tell)
        if others:
            name = pair_of(others[0])[0]
            raise SettingError(
                "{at}: "
                + literal(f"{path} has no covariate {name!r}")
                + "; `density conditional` fixes columns of the data"
            )
        return saved

    def split(self, texts: Sequence[str], tell: Sink) -> tuple[SavedDensity, list[str]]:
        """Return the density where covariates are as texts say, and the texts of other columns."""
        conditional = self.density.given
        names = (
            []
            if conditional is None
            else [name.casefold() for name in conditional.covariates.names]
        )
        pairs = [pair for text in texts if (pair := pair_of(text))[0].casefold() in names]
        others = [text for text in texts if pair_of(text)[0].casefold() not in names]
        if conditional is None or not pairs:
            return self, others
        cells = values_of(conditional, pairs)
        for doubt in conditional.covariates.doubts(cells):
            tell(Note(f"WARNING: {doubt}"))
        at = {name: cell[0].item() for name, cell in cells.items()}
        return replace(self, density=conditional.at(cells), at=at), others

    def rows(
        self, path: Path, reading: tables.TableSettings, tell: Sink, given: Sequence[str] = ()
    ) -> data.TableRows:
        """Return the rows of a table that can be of the density, and warn of what is doubtful.

        The columns are those of the fit, where none were chosen; `given` are others to read.
        """
        space = self.density.space
        names = tuple(self.extra.get("columns") or space.columns)
        names = names if len(names) in space.widths else space.columns
        said = data.Declaration(
            space.data_name, widths=space.widths, roles=space.roles, names=tuple(names)
        )
        rows = tables.read_rows(path, reading, tell, fitted=said, given=given)
        try:
            if rows.source.is_named:
                space.form_in(rows.own_names)
            doubts = inference.data_doubts(self.density, rows.values, rows.columns, rows.place)
        except SettingError as error:
            raise data.in_file(error, f"{path}: ") from error
        for doubt in doubts:
            tell(Note(f"WARNING: {path}: {doubt}"))
        return rows

    def axes(self, wanted: Sequence[str], tell: Sink = ignore) -> list[int]:
        """Return the numbers, from 0, of columns given by name, or else by number from 1.

        A column without a name is called column and its number: its number means it, and no other.
        """
        names = self.columns
        lower = {name.casefold() for name in names}
        numbers = {str(number): number - 1 for number in range(1, len(names) + 1)}
        unnamed = [re.fullmatch(r"column(\d+)", name) for name in names]
        if all(unnamed):
            numbers = {match[1]: axis for axis, match in enumerate(unnamed) if match}
        lookups = [name if name.casefold() in lower else numbers.get(name, name) for name in wanted]
        axes = inference.axes_named(lookups, names)
        for name, axis in zip(wanted, axes, strict=True):
            if name.isdigit() and not all(unnamed):
                place = f"number {name} among the model's columns ({', '.join(names)})"
                tell(Note(f"took {name} for {names[axis]}, {place}"))
        return axes

    def covariates_named(self, declared: Sequence[str]) -> list[str]:
        """Return the covariates of the fit, if these are what is asked for; none if none of them is.

        Raises `SettingError` if some of them are, and others are not, and for other roles than the
        fit's.
        """
        conditional = self.density.given
        fitted: dict[str, Covariate] = {}
        if conditional is not None:
            fitted = {column.name.casefold(): column for column in conditional.covariates.columns}
        roles = {str(name).casefold(): role for name, role in data.asked_roles(declared).items()}
        if conditional is None or not roles.keys() & fitted.keys():
            return []
        names = conditional.covariates.names
        if roles.keys() != fitted.keys():
            raise SettingError(
                "{given} must name all covariates of the fit, " + literal(", ".join(names))
            )
        for name, role in roles.items():
            before = fitted[name].role
            same_turn = role is not None and role.turn is not None and role.turn == before.turn
            if role is not None and role != before and not same_turn:
                raise SettingError(
                    f"{{given}}: {literal(fitted[name].name)} is declared as {role}, and in the fit it "
                    f"is {before}: convert it, or leave the role out"
                )
        return names


def values_of(
    density: ConditionalDensity, pairs: Sequence[tuple[str, str]], apart: Sequence[str] = ()
) -> dict[str, Values]:
    """Return the value (1,) of each covariate but those `apart`, by its name.

    Raises `SettingError` for a covariate without a value, one that there is not, and no number.
    """
    texts = {name.casefold(): text for name, text in pairs}
    names = density.covariates.names
    if unknown := sorted(set(texts) - {name.casefold() for name in names}):
        raise SettingError(
            "{at}: " + literal(f"no covariate {unknown[0]!r}; there are {', '.join(names)}")
        )
    cells: dict[str, Values] = {}
    for column in density.covariates.columns:
        text = texts.get(column.name.casefold())
        if column.name in apart:
            continue
        if text is None:
            raise SettingError(
                "{at} must say all that is known: " + literal(f"{column.name} is missing")
            )
        cells[column.name] = np.array([text if column.words else number_of(column.name, text)])
    return cells


def number_of(name: str, text: str) -> float:
    """Return the number that a text is."""
    try:
        return float(tables.with_minus(text.strip()))
    except ValueError:
        raise SettingError("{at}: " + literal(f"{name} must be a number, got {text!r}")) from None


def pair_of(text: str) -> tuple[str, str]:
    """Return the name and the value of a text such as temperature=295."""
    name, sign, value = text.rpartition("=")
    if not sign or not name.strip() or not value.strip():
        raise SettingError(f"{{at}} must be values such as psi=-45, got {literal(repr(text))}")
    return name.strip(), value.strip()
