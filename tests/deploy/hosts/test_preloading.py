"""Promises of what a fork server imports: all that agents need, and nothing of other packages."""

import subprocess
import sys

from support.fleets import PAIR

from rcopterx.deploy.hosts.launcher import modules_of
from rcopterx.deploy.processes.table import processes_of
from rcopterx.fleet.reading import parse_fleet

BUILD = """
import importlib, sys
for module in sys.argv[2:]:
    importlib.import_module(module)
imported = set(sys.modules)
from rcopterx.fleet.reading import parse_fleet
from rcopterx.deploy.roles.agent import pilot_of
pilot_of(parse_fleet(sys.argv[1]), "h2")
print(*set(sys.modules) - imported)
"""


def modules(text: str) -> list[str]:
    return modules_of(parse_fleet(text), processes_of(parse_fleet(text), "main"))


def test_an_agent_imports_nothing_after_it_was_forked() -> None:
    done = subprocess.run(
        [sys.executable, "-c", BUILD, PAIR, *modules(PAIR)], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == ""


def test_what_the_fleet_flies_with_and_what_flies_where_that_fails_are_imported() -> None:
    found = modules(PAIR + 'control = { controller = "pid" }')
    for module in ("controllers.feedback", "controllers.cascade.controller", "estimators.extended_kalman"):
        assert f"rcopterx.control.{module}" in found
    assert "rcopterx.control.controllers.feedback" not in modules(PAIR)


def test_libraries_of_the_radios_are_imported_before_a_gateway_is_needed() -> None:
    of_radio = "rcopterx.radios.mavlink"
    text = PAIR + '[defaults.transmitter]\nprotocol = "mavlink"'
    assert of_radio in modules(text)
    assert of_radio not in modules(PAIR)


def test_controllers_of_other_packages_are_left_to_the_agents() -> None:
    assert modules(PAIR + 'control = { controller = "another_packages" }') == modules(PAIR)


def test_what_only_some_fleets_need_at_the_start_of_a_process_is_imported_for_them() -> None:
    links, seats, brands = (
        "rcopterx.bus.links", "rcopterx.deploy.certificates.seats", "rcopterx.vicon_gateway.brands",
    )  # fmt: skip
    assert not {links, seats, brands} & set(modules(PAIR))
    assert links in modules(PAIR + 'host = "roof"\n[hosts.main]\n[hosts.roof]\naddress = "127.0.0.2"')
    assert seats in modules(PAIR + '[security]\ncertificates = "/tmp/certificates"')
    assert brands in modules(PAIR + '[tracker]\nbrand = "vicon_sdk"\nrate_hz = 50')
