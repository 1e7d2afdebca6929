"""Promises of Zenoh configurations: links of fleets in lockstep survive processes that get no processor."""

import json

import pytest

from rcopterx.bus.endpoints import LEASE_MS, PATIENT_LEASE_MS, client_config, router_config


@pytest.mark.parametrize(("patient", "lease_ms"), [(False, LEASE_MS), (True, PATIENT_LEASE_MS)])
def test_both_ends_of_a_link_wait_as_long_as_the_fleet_does(patient: bool, lease_ms: int) -> None:
    client = client_config(["tcp/127.0.0.1:7447"], "t", 1.0, patient=patient)
    router = router_config(["tcp/127.0.0.1:7447"], [], "t", patient=patient)
    for config in (client, router):
        assert json.loads(config.get_json("transport/link/tx/lease")) == lease_ms
