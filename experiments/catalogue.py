"""The experiments by name."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, Final

from rcopterx.experiments import (
    beyond,
    chain,
    family,
    fleets,
    formation,
    horizon,
    hover,
    preview,
    swapping,
    turning,
)
from rcopterx.experiments.runner import Experiment

_MODULES: Final = (hover, horizon, formation, preview, chain, turning, swapping, family, fleets, beyond)
EXPERIMENTS: Final[Mapping[str, Experiment[Any]]] = MappingProxyType(
    {module.EXPERIMENT.name: module.EXPERIMENT for module in _MODULES}
)
