"""Let a program in any language fly a vehicle by plain HTTP: python http_bridge.py [FLEET [VEHICLE [PORT]]].

    POST /take           take control of the vehicle, which must fly. 409 and the reason of a refusal.
                         A form may set the longest silence of the program: patience_s=0.3
    GET  /task           wait for the next task; 503 if none comes any more
    POST /answer         "number pitch roll thrust yaw" of the task answered; the reply is the next task
    POST /release        return control

A task is plain text, one field per line: its name, then its numbers. Languages that post forms send the
answer as a field of that name.

Only programs of the same user on the same computer have access: every request needs the header `X-Key` with
the secret in ~/.http_bridge.key, which the bridge writes. Web pages in a browser cannot send this header.
"""

import hmac
import os
import secrets
import sys
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import parse_qsl

from external_control import ExternalControl

FIELDS = ("motion", "disturbance", "hover_input", "input_gain", "input_min", "input_max")
LONGEST_BODY = 1000
NAMES = ("127.0.0.1", "localhost")
PATIENCE_S = 0.1


def task_text(task):
    """A task as lines of a name and numbers; of the reference only the first stage."""
    lines = [f"number {task['number']}", _line("reference", task["reference"][0])]
    return "".join(line + "\n" for line in [*lines, *(_line(name, task[name]) for name in FIELDS)])


def _line(name, values):
    return " ".join([name, *(repr(float(value)) for value in values)])


def parsed_answer(text):
    """Number of the task, and four inputs; raises ValueError."""
    number, *inputs = text.split()
    if len(inputs) != 4:
        raise ValueError(f"{len(inputs)} inputs, 4 are needed: pitch, roll, thrust, yaw")
    return int(number), [float(value) for value in inputs]


def new_key(path):
    """Write a new secret to a file that only its owner can read, and return it."""
    key = secrets.token_urlsafe(32)
    path.unlink(missing_ok=True)
    with open(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w", encoding="ascii") as file:
        file.write(key)
    return key


class Handler(BaseHTTPRequestHandler):
    """One client at a time flies the vehicle of the server."""

    protocol_version = "HTTP/1.1"
    disable_nagle_algorithm = True

    def do_GET(self):
        """Only the task can be read."""
        if not self._permitted():
            return
        if self.path == "/task":
            self._reply_with(self._task)
        else:
            self._reply(404, "GET /task\n")

    def do_POST(self):
        """Take, answer, release."""
        if not self._permitted():
            return
        text = self.headers.get("Content-Length", "0")
        length = int(text) if text.isascii() and text.isdigit() else -1
        if not 0 <= length <= LONGEST_BODY:
            self.close_connection = True
            self._reply(413, f"at most {LONGEST_BODY} bytes\n")
            return
        body = self.rfile.read(length).decode("ascii", "replace")
        form = dict(parse_qsl(body))
        actions = {
            "/take": lambda: self._take(float(form.get("patience_s", PATIENCE_S))),
            "/answer": lambda: self._answer(form.get("answer", body)),
            "/release": self._release,
        }
        if self.path in actions:
            self._reply_with(actions[self.path])
        else:
            self._reply(404, "POST /take, /answer or /release\n")

    def log_message(self, *_):
        """Fifty requests a second are not logged."""

    def _permitted(self):
        """Whether a program of this user sends the request; refuse it otherwise."""
        host = self.headers.get("Host", "").partition(":")[0]
        key = self.headers.get("X-Key", "").encode(errors="replace")
        if host in NAMES and hmac.compare_digest(key, self.server.key.encode()):
            return True
        self.close_connection = True
        self._reply(403, "the header X-Key must have the secret in ~/.http_bridge.key\n")
        return False

    def _take(self, patience_s):
        self.server.vehicle.take(patience_s)
        return self._task()

    def _task(self):
        return task_text(self.server.vehicle.next_task())

    def _answer(self, body):
        number, inputs = parsed_answer(body)
        self.server.vehicle.answer({"number": number}, [inputs])
        return self._task()

    def _release(self):
        self.server.vehicle.release()
        return "released\n"

    def _reply_with(self, action):
        try:
            with self.server.one_at_a_time:
                text = action()
        except ValueError as error:
            self._reply(400, f"{error}\n")
        except TimeoutError as error:
            self._reply(503, f"{error}\n")
        except RuntimeError as error:
            self._reply(409, f"{error}\n")
        else:
            self._reply(200, text)

    def _reply(self, status, text):
        data = text.encode()
        self.send_response(status)
        self.send_header("Content-Type", "text/plain; charset=utf-8")
        self.send_header("Content-Length", str(len(data)))
        self.end_headers()
        self.wfile.write(data)


class Bridge(ThreadingHTTPServer):
    """HTTP server in front of a vehicle that `ExternalControl` flies."""

    daemon_threads = True

    def __init__(self, vehicle, port=8050):
        super().__init__(("127.0.0.1", port), Handler)
        self.vehicle = vehicle
        self.key = new_key(Path.home() / ".http_bridge.key")
        self.one_at_a_time = threading.Lock()


def main(fleet="trio", vehicle="h1", port="8050", **options):
    """Serve until Ctrl-C."""
    control = ExternalControl(fleet, vehicle, name="http_client", **options)
    with Bridge(control, int(port)) as bridge:
        try:
            bridge.serve_forever()
        except KeyboardInterrupt:
            control.close()


if __name__ == "__main__":
    main(*sys.argv[1:])
