"""A gRPC client in Python that counts: how many forces come from the daemon, how evenly it sends them, how long they take.

    beside.py ADDRESS RATE_HZ SECONDS FILE

When the daemon sent each goes to FILE, in ns since 1970, as 64-bit numbers.
"""

import array
import pathlib
import sys
import time

sys.path.insert(0, str(pathlib.Path(__file__).parent.parent / "e2e"))
from foreign import Client  # noqa: E402
from stage import evenness, quantiles  # noqa: E402


def main():
    address, rate_hz, seconds, file = sys.argv[1], float(sys.argv[2]), float(sys.argv[3]), sys.argv[4]
    sent, came, took = (array.array("q") for _ in range(3))
    end = time.monotonic() + seconds
    for sample in Client(address).stream("ForceService/StreamForce", timeout=seconds + 60, rate_hz=rate_hz):
        if time.monotonic() > end:
            break
        if not sample.HasField("time"):
            continue
        came.append(time.time_ns())
        age_ns = round(sample.age_s * 1e9)
        # The daemon's label of a frame's time moves a little from sample to sample; its monotonic time does not.
        sent.append(sample.monotonic_ns + age_ns)
        took.append(came[-1] - sample.time.ToNanoseconds() - age_ns)
    pathlib.Path(file).write_bytes(array.array("q", (at - way for at, way in zip(came, took))))
    print(f"gRPC, {rate_hz:.0f} Hz asked for: {len(sent)} samples, {evenness(sent, rate_hz)}")
    print(f"  daemon's sending to here: {quantiles(took)}; between two arrivals {evenness(came, rate_hz)}")


if __name__ == "__main__":
    main()
