"""The official SDK as a client: prints what it sees, one JSON object per frame, until it is killed.

A process of its own, because `connect` holds the interpreter's lock and `waitForNextFrame` never gives up.
"""

import json
import os
import sys


def main() -> None:
    output = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)  # the library's own messages do not belong into the data
    import motioncapture

    capture = motioncapture.connect("vicon", {"hostname": sys.argv[1]})
    while True:
        capture.waitForNextFrame()
        seen = {}
        for name, body in capture.rigidBodies.items():
            rotation = body.rotation
            quaternion = [float(value) for value in (rotation.x, rotation.y, rotation.z, rotation.w)]
            seen[name] = [[float(value) for value in body.position], quaternion]
        output.write(json.dumps(seen) + "\n")


if __name__ == "__main__":
    main()
