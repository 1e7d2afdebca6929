"""Promises of Zenoh configurations: links of fleets in lockstep survive processes that get no processor."""

import json
import os
import select
import signal
import subprocess
import sys
from pathlib import Path
from typing import IO

import pytest
import zenoh
from support.waiting import wait_for

from rcopterx.bus.endpoints import LEASE_MS, PATIENT_LEASE_MS, client_config, open_session, router_config

ROUTER = """
import signal, sys
from rcopterx.bus.endpoints import open_session, router_config
router = open_session(router_config([sys.argv[1]], [], "t", patient=True))
signal.pause()
"""
RECEIVER = """
import sys, threading
from zenoh.handlers import Callback
from rcopterx.bus.endpoints import client_config, open_session
session = open_session(client_config([sys.argv[1]], "t", 30.0, patient=True))
connected, arrived = threading.Event(), threading.Semaphore(0)

def receive(sample):
    arrived.release() if sample.payload.to_bytes() else connected.set()

subscriber = session.declare_subscriber("key", Callback(receive, indirect=False))
connected.wait()
print("ready", flush=True)
for _ in range(int(sys.argv[2])):
    arrived.acquire()
print("complete", flush=True)
"""
MESSAGES, BYTES = 200, 4000


def readable(stream: IO[str]) -> bool:
    return bool(select.select([stream], [], [], 0.0)[0])


@pytest.mark.parametrize(("patient", "lease_ms"), [(False, LEASE_MS), (True, PATIENT_LEASE_MS)])
def test_both_ends_of_a_link_wait_as_long_as_the_fleet_does(patient: bool, lease_ms: int) -> None:
    client = client_config(["tcp/127.0.0.1:7447"], "t", 1.0, patient=patient)
    router = router_config(["tcp/127.0.0.1:7447"], [], "t", patient=patient)
    for config in (client, router):
        assert json.loads(config.get_json("transport/link/tx/lease")) == lease_ms


@pytest.mark.timeout(60)
def test_what_is_sent_to_a_stopped_process_waits_and_delays_no_other(tmp_path: Path) -> None:
    endpoint = f"unixsock-stream/{os.path.relpath(tmp_path / 'router')}"
    router = subprocess.Popen([sys.executable, "-c", ROUTER, endpoint])
    words = [sys.executable, "-c", RECEIVER, endpoint, str(MESSAGES)]
    receiver = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
    try:
        assert receiver.stdout is not None
        block, low = zenoh.CongestionControl.BLOCK, zenoh.Priority.DATA_LOW
        others: list[bytes] = []
        with (
            open_session(client_config([endpoint], "t", 30.0, patient=True)) as sender,
            open_session(client_config([endpoint], "t", 30.0, patient=True)) as other,
        ):
            other.declare_subscriber("other", lambda sample: others.append(sample.payload.to_bytes()))
            wait_for(lambda: sender.put("other", b"first") or others, "the other process is not there")
            ready = receiver.stdout
            wait_for(lambda: sender.put("key", b"") or readable(ready), "the receiver is not there")
            assert ready.readline() == "ready\n"
            receiver.send_signal(signal.SIGSTOP)
            for _ in range(MESSAGES):
                sender.put("key", bytes(BYTES), congestion_control=block, priority=low)
            sender.put("other", b"last", congestion_control=block)
            wait_for(lambda: b"last" in others, "another process waits for the stopped one", 3.0)
            receiver.send_signal(signal.SIGCONT)
            assert receiver.stdout.readline() == "complete\n"
    finally:
        for process in (receiver, router):
            process.kill()
            process.wait()
        if receiver.stdout is not None:
            receiver.stdout.close()
