"""JSON schema of the fleet file: `python docs/generators/fleet_schema.py > docs/fleet.schema.json`."""

import json
from typing import Any

import msgspec

from messages_page import meanings_of
from rcopterx.fleet import schema


def reference() -> str:
    """Return the text of `docs/fleet.schema.json`, by which editors complete and check fleet files."""
    document: dict[str, Any] = msgspec.json.schema(schema.FleetFile)
    tables = document["$defs"]
    for name, table in tables.items():
        for key, meaning in meanings_of(getattr(schema, name)).items():
            table["properties"][key]["description"] = meaning
    shared = {key: value for key, value in tables["VehicleConfig"].items() if key != "required"}
    tables["Defaults"] = shared | {"title": "Defaults", "description": "Keys that all vehicles share."}
    tables["FleetFile"]["properties"]["defaults"] = {"$ref": "#/$defs/Defaults"}
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": "Fleet file of rcopterx"}
    return json.dumps(head | document, indent=1, ensure_ascii=False) + "\n"


if __name__ == "__main__":
    print(reference(), end="")
