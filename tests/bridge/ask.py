"""What a robot of a fleet is asked for."""

import json
import subprocess

from google.protobuf.message_factory import GetMessageClass

from stage import PATIENCE_S


def asked(scene, model_set):
    """What a robot answers, by our own command and by foreign hands, is what its daemon answers."""
    pool, daemon = scene.truth.client.pool, scene.truth.client
    decode = lambda name, reply: GetMessageClass(pool.FindMessageTypeByName(f"taxel.v1.{name}")).FromString(bytes(reply.ok.payload))

    def command(*words, allowed=0):
        done = subprocess.run([scene.bridge, "ask", "--router", scene.endpoint, *words], capture_output=True, text=True)
        assert done.returncode == allowed, f"{words}: {done}"
        return done

    [reply] = list(scene.session.get("taxel/icub01/events", timeout=PATIENCE_S))
    events = decode("ListEventsResponse", reply).events
    assert events and len(events) == len({event.number for event in events}), events
    lines = [json.loads(line) for line in command("events", "icub01", "--json", "--count", "1000").stdout.splitlines()]
    assert {(event.number, event.text) for event in events} <= {(line["number"], line["text"]) for line in lines}, lines
    exported = daemon.call("ModelService/ExportModelSet", model_set=model_set).json
    models = scene.stage.scratch / "models.json"
    models.write_text(exported)
    assert command("import", "icub01", models).stdout.strip() == model_set
    models.write_text("{}")
    refused = command("import", "icub01", models, allowed=1).stderr
    code, details = daemon.refused("ModelService/ImportModelSet", json="{}")
    assert "icub01" in refused and details in refused, (refused, code, details)
    [reply] = list(scene.session.get("taxel/icub01/events", payload=b"\xff\xff", timeout=PATIENCE_S))
    assert reply.err and b"request" in bytes(reply.err.payload), reply
    [reply] = list(scene.session.get("taxel/*/events", timeout=PATIENCE_S))
    assert reply.err and b"expected taxel/icub01/events itself" in bytes(reply.err.payload), reply
    [reply] = list(scene.session.get("taxel/icub01/import", payload=bytes(18 << 20), timeout=PATIENCE_S))
    assert reply.err and b"18874368 bytes, at most 17825792 are taken" in bytes(reply.err.payload), reply
    told = command("events", "icub01", "--count", "3").stdout
    assert len(told.splitlines()) == 3 and all(" s ago  left_forearm  " in line for line in told.splitlines()), told
    none = command("events", "icub99", allowed=1).stderr
    assert "icub99" in none, none
    print(f"asked: {len(events)} events, models taken", flush=True)
