"""Controllers by name: the built-in ones and those that installed packages add.

A package adds a controller through the entry-point group `rcopterx.controllers`; the entry point names a
class with an attribute `Settings` (a `ControllerSettings` type), built from (model, period_s, settings).
A controller's module is imported only when that controller is asked for; agents start quickly.
"""

from typing import Final

from rcopterx.control.interfaces import Controller
from rcopterx.control.plugins.registry import Registry

CONTROLLERS: Final = Registry[Controller](
    "controller",
    "rcopterx.controllers",
    {
        "cascade": "rcopterx.control.controllers.cascade.controller:CascadeController",
        "lqr": "rcopterx.control.controllers.lqr:LqrController",
        "paper": "rcopterx.control.controllers.paper.controller:PaperController",
        "pid": "rcopterx.control.controllers.pid:PidController",
    },
)
