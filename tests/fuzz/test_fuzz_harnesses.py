"""Inputs that coverage-guided fuzzing found give a result or the documented error."""

import pytest
from fuzz_harnesses import CORPUS, HARNESSES


@pytest.mark.parametrize("name", HARNESSES)
def test_every_input_of_the_corpus_gives_a_result_or_the_documented_error(name: str) -> None:
    inputs = sorted((CORPUS / name).iterdir())
    assert inputs
    for path in inputs:
        try:
            HARNESSES[name](path.read_bytes())
        except Exception as error:
            raise AssertionError(f"{path.name} fails") from error
