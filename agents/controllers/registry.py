"""Controllers by name: the built-in ones and those that installed packages add.

A package adds a controller through the entry-point group `rcopterx.controllers`; the entry point names a
class with an attribute `Settings` (a `ControllerSettings` type), built from (model, period_s, settings).
A controller's module is imported only when that controller is asked for; agents start quickly.
"""

from typing import Final

from rcopterx.agents.interfaces import Controller
from rcopterx.agents.plugins.registry import Registry

CONTROLLERS: Final = Registry[Controller](
    "controller",
    "rcopterx.controllers",
    {
        "cascade": "rcopterx.agents.controllers.cascade.controller:CascadeController",
        "lqr": "rcopterx.agents.controllers.lqr:LqrController",
        "paper": "rcopterx.agents.controllers.paper.controller:PaperController",
        "pid": "rcopterx.agents.controllers.pid:PidController",
    },
)
