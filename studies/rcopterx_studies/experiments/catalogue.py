"""The experiments by name."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, Final

from rcopterx_studies.experiments import bound, chain, family, fleets, formation, hover, lever_arm
from rcopterx_studies.experiments.runner import Experiment

_MODULES: Final = (hover, formation, chain, family, lever_arm, fleets, bound)
EXPERIMENTS: Final[Mapping[str, Experiment[Any]]] = MappingProxyType(
    {module.EXPERIMENT.name: module.EXPERIMENT for module in _MODULES}
)
