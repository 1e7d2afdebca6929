"""Promises of files that other programs read: each is valid by its published schema."""

import pytest
from check_jsonschema import main
from click.testing import CliRunner
from packaging_support import ROOT

FILES = {
    "CITATION.cff": "citation-file-format",
    "examples/two_hosts/compose.yaml": "compose-spec",
    ".github/workflows/ci.yml": "github-workflows",
}


@pytest.mark.parametrize(("path", "schema"), FILES.items(), ids=FILES)
def test_a_file_is_valid_by_its_schema(path: str, schema: str) -> None:
    result = CliRunner().invoke(main, ["--builtin-schema", f"vendor.{schema}", str(ROOT / path)])
    assert result.exit_code == 0, result.output


def test_a_file_that_is_not_valid_is_found() -> None:
    result = CliRunner().invoke(
        main, ["--builtin-schema", "vendor.compose-spec", str(ROOT / "packaging" / "mkdocs.yml")]
    )
    assert result.exit_code != 0
