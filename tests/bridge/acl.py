"""The router of deploy/zenoh-router.json5: who may say what. Robots and readers here are foreign sessions with certificates."""

import pathlib
import subprocess

import zenoh
from stage import free_port, until

DEPLOY = pathlib.Path(__file__).parent.parent.parent / "deploy"


def openssl(folder, *arguments):
    subprocess.run(["openssl", *arguments], cwd=folder, check=True, capture_output=True)


def certificate(folder, file, name):
    openssl(folder, "req", "-newkey", "rsa:2048", "-nodes", "-keyout", f"{file}.key", "-out", f"{file}.csr", "-subj", f"/CN={name}")
    (folder / "names").write_text("subjectAltName=DNS:localhost,IP:127.0.0.1\n")
    openssl(folder, "x509", "-req", "-in", f"{file}.csr", "-CA", "ca.pem", "-CAkey", "ca.key", "-CAcreateserial",
            "-days", "30", "-extfile", "names", "-out", f"{file}.pem")


def configuration(folder, source, port, file=None):
    """The documented file with the folder and the port of this test."""
    text = (DEPLOY / source).read_text().replace("/etc/taxeld/", f"{folder}/")
    text = text.replace("tls/[::]:7447", f"tls/127.0.0.1:{port}").replace("tls/fleet.example:7447", f"tls/127.0.0.1:{port}")
    if file:
        text = text.replace("/robot.", f"/{file}.")
    path = folder / f"{file or source}.json5"
    path.write_text(text)
    return path


def acl(stage, scratch):
    folder, port = scratch.resolve() / "acl", free_port()
    folder.mkdir(exist_ok=True)
    openssl(folder, "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "30", "-keyout", "ca.key", "-out", "ca.pem",
            "-subj", "/CN=fleet")
    for file, name in [("router", "router"), ("icub01", "icub01"), ("thief", "thief"), ("reader", "fleet-reader")]:
        certificate(folder, file, name)
    stage.router(config=configuration(folder, "zenoh-router.json5", port))

    def session(file):
        return zenoh.open(zenoh.Config.from_file(str(configuration(folder, "zenoh-robot.json5", port, file))))

    robot, thief, reader, writer = session("icub01"), session("thief"), session("reader"), session("reader")
    heard = []
    forces = reader.declare_subscriber("taxel/**", lambda sample: heard.append((str(sample.key_expr), bytes(sample.payload))))

    def told():
        # Each before the true one, so that it would be there if it was let through.
        thief.put("taxel/icub01/force/arm", b"thief")
        robot.put("taxel/icub02/force/arm", b"not mine")
        writer.put("taxel/icub01/force/arm", b"reader")
        robot.put("taxel/icub01/force/arm", b"true")
        return len([one for one in heard if one[1] == b"true"]) > 20

    until("the robot is heard", told)
    assert set(heard) == {("taxel/icub01/force/arm", b"true")}, set(heard)
    forces.undeclare()
    for one in [robot, thief, reader, writer]:
        one.close()
    print("the documented router: a robot speaks for itself alone, readers only read, a stranger does neither", flush=True)
