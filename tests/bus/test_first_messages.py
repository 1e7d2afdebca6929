"""The first message of a type may arrive in several threads of a process at once."""

import subprocess
import sys
from pathlib import Path

TESTS = Path(__file__).parents[1]
FIRST_MESSAGES = """
import sys, threading
import msgspec
from support.messages import MESSAGE_TYPES
from rcopterx.bus.codec import RejectedError, decode

def receive():
    for kind in MESSAGE_TYPES:
        payload = msgspec.msgpack.encode(dict.fromkeys(reversed(kind.__struct_fields__)))
        together.wait()
        try:
            decode(payload, kind)
        except RejectedError:
            pass

sys.setswitchinterval(1e-6)
together = threading.Barrier(3)
threads = [threading.Thread(target=receive) for _ in range(3)]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
"""


def test_threads_may_receive_the_first_message_of_a_type_at_once() -> None:
    done = subprocess.run([sys.executable, "-c", FIRST_MESSAGES], cwd=TESTS, check=False)
    assert done.returncode == 0
