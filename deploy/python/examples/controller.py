#!/usr/bin/env python3
"""A robot controller that reads the force of the skin: the newest sample, only if it is good and fresh.

usage: controller.py [ADDRESS [PATCH]]
"""

import sys
import time

import taxel

LOOP_S = 0.010  # the control loop's own period


def main():
    forces = taxel.connect(*sys.argv[1:3], rate_hz=200.0)
    cycle, next_cycle = 0, time.monotonic()
    while True:
        force = forces.force()
        # Here the controller acts. This one shows what it has, twice a second.
        if cycle % 50 == 0:
            print(f"{force.total_n:6.2f} N, {1e3 * force.age_s:3.0f} ms old" if force else f"no force: {force}", flush=True)
        cycle += 1
        next_cycle = max(next_cycle + LOOP_S, time.monotonic())
        time.sleep(max(0.0, next_cycle - time.monotonic()))


if __name__ == "__main__":
    try:
        main()
    except KeyboardInterrupt:
        pass
