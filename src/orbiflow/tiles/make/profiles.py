"""Machines with their materials, kept by name in the user's configuration folder."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from platformdirs import user_config_path

from orbiflow.errors import OrbiflowError, SettingError, literal
from orbiflow.runtime import is_object, make_folder, read_json, write_atomic
from orbiflow.settings import Field, check_names, check_rules, fields_of, meant
from orbiflow.tiles.make.export_settings import ExportSettings

OF_MACHINE = ("kerf", "power", "bed", "margin", "tabs", "tab_width")
"""The settings of an export that a profile may hold: those of a machine and its material."""

LONGEST_NAME, MOST_PROFILES = 80, 200


def profiles_file() -> Path:
    """Return the file of the user's profiles, which need not be there."""
    return user_config_path("orbiflow") / "profiles.json"


@dataclass(frozen=True)
class Profiles:
    """Settings of exports that are kept by name, such as "my K40, 3 mm birch", in a file of JSON.

    Lengths in it are texts with a unit, for people to read and change::

        {"my K40, 3 mm birch": {"kerf": "0.15mm", "bed": "300x200mm", "power": 20}}
    """

    file: Path = field(default_factory=profiles_file)

    def read(self) -> dict[str, dict[str, Any]]:
        """Return the settings of each profile, lengths in mm.

        Raises:
            OrbiflowError: If the file cannot be read, or something in it is no setting of a profile.
        """
        if not self.file.exists():
            return {}
        kept = read_json(self.file, "profiles by name")
        return {name: self._checked(name, settings) for name, settings in kept.items()}

    def keep(self, name: str, settings: Mapping[str, Any]) -> str:
        """Keep settings under a name, in place of what it had; return it with single blanks."""
        title = " ".join(name.split())
        if not title or len(title) > LONGEST_NAME or not title.isprintable():
            raise OrbiflowError(f"a profile's name has 1 to {LONGEST_NAME} letters")
        kept = {**self.read(), title: self._checked(title, dict(settings))}
        if len(kept) > MOST_PROFILES:
            raise OrbiflowError(f"there are {MOST_PROFILES} profiles; forget one of them first")
        self._write(kept)
        return title

    def forget(self, name: str) -> None:
        """Remove a profile, if it is there."""
        self._write({key: settings for key, settings in self.read().items() if key != name})

    def applied(self, name: str, settings: ExportSettings) -> tuple[ExportSettings, list[str]]:
        """Return settings with those of a profile that were not given, and names of some left out.

        These do not apply to what is made.
        """
        profiles, left = self.read(), list[str]()
        if name not in profiles:
            hint = meant(name, list(profiles))
            hint = hint or f"there are {', '.join(map(repr, profiles)) or 'none'}"
            raise SettingError(literal(f"there is no profile {name!r} in {self.file}; {hint}"))
        fields = _fields()
        for key, value in profiles[name].items():
            if key in settings.fields_given:
                continue
            try:
                check_rules([fields[key]], {**vars(settings), key: value}, [key])
            except SettingError:
                left.append(key)  # such as the kerf, where lines are cut once
            else:
                settings = settings.replace(**{key: value})
        return settings, left

    def _checked(self, name: str, settings: object) -> dict[str, Any]:
        """Return settings as `export` takes them."""
        if not is_object(settings):
            raise OrbiflowError(f"{self.file}: profile {name!r} is no object of settings; mend it")
        fields = _fields()
        try:
            check_names(settings, fields.values(), "a profile")
            return {key: fields[key].read(value) for key, value in settings.items()}
        except SettingError as error:
            raise OrbiflowError(f"{self.file}: profile {name!r}: {error}") from error

    def _write(self, profiles: dict[str, dict[str, Any]]) -> None:
        fields = _fields()
        texts = {
            name: {key: _text(fields[key], value) for key, value in settings.items()}
            for name, settings in profiles.items()
        }
        make_folder(self.file.parent)
        write_atomic(self.file, json.dumps(texts, indent=2, ensure_ascii=False) + "\n")


def _fields() -> dict[str, Field]:
    return {entry.name: entry for entry in fields_of(ExportSettings) if entry.name in OF_MACHINE}


def _text(entry: Field, value: Any) -> Any:
    """Return a value as people write it."""
    if value is None or entry.kind.unit != "mm":
        return entry.kind.plain(value)
    sides = value if isinstance(value, tuple) else (value,)
    return "x".join(f"{side:g}" for side in sides) + "mm"
