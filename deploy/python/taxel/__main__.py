"""`python -m taxel [PAGE]`: a controller that reads the force from shared memory a thousand times a second."""

import sys
import time

from .shm import Reader


def main() -> None:
    reader = Reader(sys.argv[1] if len(sys.argv) > 1 else "/dev/shm/taxeld/left_forearm")
    cycle = 0
    while True:
        force = reader.force()
        # Here a controller acts. This one shows what it has, twice a second.
        if cycle % 500 == 0:
            text = f"{force.total_n:6.2f} N, {1e3 * force.age_s:3.0f} ms old" if force else f"no force: {force}"
            print(text, flush=True)
        cycle += 1
        time.sleep(0.001)


if __name__ == "__main__":
    try:
        main()
    except KeyboardInterrupt:
        pass
