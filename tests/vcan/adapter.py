#!/usr/bin/env python3
"""A CAN adapter on a serial line, for tests in the lab: `adapter.py NAME` makes the interface NAME, up at 1 Mbit/s.

The kernel's driver slcan takes the serial line, a pseudo terminal, for an adapter with a controller of its own. Each line
that comes in goes to the driver as a message of the adapter: `t3012AABB` a frame, `sw096096` `sp128128` `sa000000` `sb256000`
the controller's state with its error counters, `e1s` an error on the bus. The end of the input unplugs the adapter.
"""

import fcntl
import os
import pty
import struct
import subprocess
import sys
import threading
import tty

TIOCSETD, N_SLCAN, SIOCGIFNAME = 0x5423, 17, 0x8910

adapter, line = pty.openpty()
tty.setraw(line)
fcntl.ioctl(line, TIOCSETD, struct.pack("i", N_SLCAN))
made = fcntl.ioctl(line, SIOCGIFNAME, bytes(16)).rstrip(b"\0").decode()


def swallow():
    """What the driver says to its adapter is not answered, but the line must not run full."""
    while os.read(adapter, 4096):
        pass


threading.Thread(target=swallow, daemon=True).start()
for command in (f"{made} name {sys.argv[1]}", f"{sys.argv[1]} type can bitrate 1000000", f"{sys.argv[1]} up"):
    subprocess.run(["ip", "link", "set", *command.split()], check=True)
print("up", flush=True)
for message in sys.stdin:
    os.write(adapter, message.strip().encode() + b"\r")
