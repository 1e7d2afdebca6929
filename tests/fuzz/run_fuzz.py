"""Fuzzes the readers of bytes from outside, guided by coverage.

    make fuzz ARGS="codec 300"

runs one harness (all without a name) for a time [s]. New inputs are stored in `build/fuzz`, and one that
fails is printed and left in `build/fuzz/NAME-crash-...`. Add it, as small as possible, to `corpus/NAME`.
"""

import os
import subprocess
import sys
from pathlib import Path

# Kernels as plain Python: machine code cannot be instrumented.
os.environ["NUMBA_DISABLE_JIT"] = "1"

import atheris

WORK = Path("build") / "fuzz"
SECONDS = "300"
LARGEST_INPUT = 20_000
PATIENCE_S = 100
"""For one input, on a computer where fuzzing gets no processor for seconds."""
INSTRUMENTED = ["rcopterx", "tomllib", "mcap"]


def run(name: str, seconds: str) -> None:
    """Fuzz with one harness; ends the process."""
    with atheris.instrument_imports(include=INSTRUMENTED):
        from tests.fuzz.fuzz_harnesses import CORPUS, HARNESSES
    found = WORK / name
    found.mkdir(parents=True, exist_ok=True)
    options = [f"-max_total_time={seconds}", f"-artifact_prefix={WORK / name}-", f"-max_len={LARGEST_INPUT}"]
    limits = [f"-timeout={PATIENCE_S}", "-rss_limit_mb=1000", "-print_final_stats=1"]
    atheris.Setup([sys.argv[0], *options, *limits, str(found), str(CORPUS / name)], HARNESSES[name])
    atheris.Fuzz()


def main(arguments: list[str]) -> int:
    """Run one harness, or each in a process of its own; return 1 if one fails."""
    seconds = next((argument for argument in arguments if argument.isdigit()), SECONDS)
    names = [argument for argument in arguments if not argument.isdigit()]
    if len(names) == 1:
        run(names[0], seconds)
    from tests.fuzz.fuzz_harnesses import HARNESSES

    command = [sys.executable, "-m", "tests.fuzz.run_fuzz"]
    return max(subprocess.run([*command, name, seconds]).returncode for name in names or HARNESSES)


if __name__ == "__main__":
    sys.exit(min(1, main(sys.argv[1:])))
