"""Collects the licence texts of every crate that is linked into the wheel.

python .ci/third_party.py            writes THIRD-PARTY-LICENSES.txt
python .ci/third_party.py --check    fails when the file is not what Cargo.lock makes of it
"""

import json
import subprocess
import sys
from collections import defaultdict
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parent.parent
TARGET = ROOT / "THIRD-PARTY-LICENSES.txt"
NAMES = ("LICENSE", "LICENCE", "COPYING", "NOTICE", "COPYRIGHT", "UNLICENSE")
HEAD = """Licences of the Rust crates that are linked into siloscope's compiled core, on one platform or another.

The core also contains parts of the Rust standard library (MIT OR Apache-2.0).
`make third-party` writes this file from Cargo.lock.
"""


def linked_packages() -> list[dict[str, Any]]:
    """Crates of other authors that become part of the extension module, by name and version."""
    command = ["cargo", "metadata", "--format-version", "1", "--locked", "--manifest-path", str(ROOT / "Cargo.toml")]
    found = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    packages = {package["id"]: package for package in found["packages"]}
    nodes = {node["id"]: node for node in found["resolve"]["nodes"]}
    pending = [package["id"] for package in found["packages"] if package["name"] == "siloscope-py"]
    seen: set[str] = set()
    while pending:
        if (current := pending.pop()) in seen or is_macro(packages[current]):
            continue
        seen.add(current)
        for dependency in nodes[current]["deps"]:
            if any(kind["kind"] is None for kind in dependency["dep_kinds"]):
                pending.append(dependency["pkg"])
    linked = [packages[one] for one in seen if packages[one]["source"] is not None]
    return sorted(linked, key=lambda package: (package["name"], package["version"]))


def is_macro(package: dict[str, Any]) -> bool:
    """Whether a crate only runs in the compiler."""
    return any("proc-macro" in target["kind"] for target in package["targets"])


def licence_texts(package: dict[str, Any]) -> list[str]:
    """Texts of the licence files of a crate, of C sources that it carries too."""
    home = Path(package["manifest_path"]).parent
    files = [path for folder in (home, *home.glob("*/")) for path in sorted(folder.glob("*")) if is_licence(path)]
    texts = (path.read_text(encoding="utf-8", errors="replace") for path in files)
    return ["\n".join(line.rstrip() for line in text.strip().splitlines()) for text in texts]


def is_licence(path: Path) -> bool:
    return path.is_file() and path.name.upper().startswith(NAMES) and path.suffix not in {".rs", ".py", ".toml"}


def document() -> str:
    """The whole file: a list of crates, then each distinct text once with the crates that carry it."""
    packages = linked_packages()
    carriers: dict[str, list[str]] = defaultdict(list)
    lines = [HEAD, "Crates", "======", ""]
    for package in packages:
        name = f"{package['name']} {package['version']}"
        authors = f", by {', '.join(package['authors'])}" if package["authors"] else ""
        texts = licence_texts(package)
        lines.append(f"{name}: {package['license']}{'' if texts else authors + ' (carries no licence text)'}")
        for text in dict.fromkeys(texts):
            carriers[text].append(name)
    for text, names in carriers.items():
        lines += ["", "-" * 100, ", ".join(names), "-" * 100, "", text]
    return "\n".join(lines) + "\n"


def main() -> int:
    if "--check" not in sys.argv[1:]:
        TARGET.write_text(document(), encoding="utf-8")
        return 0
    if TARGET.is_file() and TARGET.read_text(encoding="utf-8") == document():
        return 0
    print(f"{TARGET.name} is not what Cargo.lock makes of it: run `make third-party`", file=sys.stderr)
    return 1


if __name__ == "__main__":
    sys.exit(main())
