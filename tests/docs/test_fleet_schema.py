"""Promises of the JSON schema of fleet files: up to date, accepts what flies, refuses what does not."""

import json
import tomllib
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from fleet_schema import reference
from rcopterx import deploy
from rcopterx.fleet.reading import shipped_fleets

FILE = Path(deploy.__file__).resolve().parents[1] / "docs" / "fleet.schema.json"


def test_the_schema_is_what_the_types_say_now() -> None:
    command = "python docs/generators/fleet_schema.py > docs/fleet.schema.json"
    assert FILE.read_text(encoding="utf-8") == reference(), f"run: {command}"


def test_every_key_is_explained() -> None:
    tables = json.loads(FILE.read_text(encoding="utf-8"))["$defs"]
    unexplained = [
        f"{name}.{key}"
        for name, table in tables.items()
        for key, value in table["properties"].items()
        if not value.get("description") and "$ref" not in value
    ]
    assert unexplained == []


@pytest.fixture(scope="module")
def validator() -> Any:
    return jsonschema.Draft202012Validator(json.loads(FILE.read_text(encoding="utf-8")))


@pytest.mark.parametrize("path", shipped_fleets().values(), ids=lambda path: path.stem)
def test_shipped_fleets_fit_the_schema(path: Path, validator: Any) -> None:
    assert [error.message for error in validator.iter_errors(tomllib.loads(path.read_text("utf-8")))] == []


@pytest.mark.parametrize(
    "text",
    ["[trakcer]", '[tracker]\nrate = "fast"', "[volume]\nmin_m = [0, 0]", "[defaults.contrl]"],
)
def test_a_wrong_key_or_value_does_not(text: str, validator: Any) -> None:
    vehicle = '[vehicles.h1]\nsubject = "a"\ntransmitter = { port = "b" }'
    good = tomllib.loads(f'name = "lab"\n{vehicle}')
    assert validator.is_valid(good)
    assert not validator.is_valid(good | tomllib.loads(text))
