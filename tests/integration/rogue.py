"""A foreign program that publishes and serves given keys with plain Zenoh: `python rogue.py JSON`.

It prints `refused` if the router rejects it, otherwise the number of requests it got.
"""

import json
import sys
import time

import zenoh

from rcopterx.bus.endpoints import Credentials, client_config


def main() -> None:
    """Connect, publish and serve."""
    order = json.loads(sys.argv[1])
    shown = Credentials(*order["shown"]) if order["shown"] else None
    config = client_config([order["endpoint"]], order["namespace"], 1.0, shown)
    if order["endpoint"].startswith("tls/") and shown is None:
        # It encrypts and trusts the authority, but has no certificate.
        config.insert_json5("transport/link/protocols", json.dumps(["tls"]))
        config.insert_json5("transport/link/tls/root_ca_certificate", json.dumps(order["authority"]))
    try:
        session = zenoh.open(config)
    except zenoh.ZError:
        print("refused")
        return
    requests: list[str] = []

    def take(query: zenoh.Query) -> None:
        requests.append(str(query.key_expr))
        with query:
            query.reply(query.key_expr, b"")

    served = [session.declare_queryable(key, take) for key in order["serve"]]
    publishers = [(session.declare_publisher(key), bytes.fromhex(text)) for key, text in order["say"]]
    until_s, said = time.monotonic() + order["for_s"], 0
    while time.monotonic() < until_s:
        for publisher, payload in publishers:
            publisher.put(payload)
            said += 1
        if not order["flood"]:
            time.sleep(0.02)
    print(json.dumps({"asked": len(requests), "said_hz": said / order["for_s"], "served": len(served)}))
    session.close()


if __name__ == "__main__":
    main()
