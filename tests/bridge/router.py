"""A router of Zenoh until it is ended: router.py ENDPOINT, or router.py --config FILE."""

import json
import sys
import threading

import zenoh


def main():
    if sys.argv[1] == "--config":
        config = zenoh.Config.from_file(sys.argv[2])
    else:
        config = zenoh.Config()
        config.insert_json5("listen/endpoints", json.dumps([sys.argv[1]]))
        config.insert_json5("scouting/multicast/enabled", "false")
    config.insert_json5("mode", '"router"')
    with zenoh.open(config):
        print("ready", flush=True)
        threading.Event().wait()


if __name__ == "__main__":
    main()
