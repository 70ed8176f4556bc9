"""Checks wheels that can't be run here: machine type, newest glibc symbol, licence texts.

python .ci/inspect_wheels.py WHEEL...
"""

import io
import re
import sys
import zipfile
from pathlib import Path

from elftools.elf.elffile import ELFFile

MACHINES = {"x86_64": "EM_X86_64", "aarch64": "EM_AARCH64"}
NEWEST_GLIBC = (2, 17)
TEXTS = ("LICENSE", "THIRD-PARTY-LICENSES.txt")


def faults(wheel: Path) -> list[str]:
    """What is wrong with a wheel, one sentence each."""
    expected = next(value for key, value in MACHINES.items() if wheel.stem.endswith(key))
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
        core = [name for name in names if re.fullmatch(r"siloscope/_core[^/]*\.so", name)]
        if len(core) != 1:
            return [f"{len(core)} compiled cores"]
        elf = ELFFile(io.BytesIO(archive.read(core[0])))
    found = [
        f"no licence text {text}" for text in TEXTS if not any(name.endswith(f"licenses/{text}") for name in names)
    ]
    if elf.header["e_machine"] != expected:
        found.append(f"machine {elf.header['e_machine']}, not {expected}")
    if (newest := newest_glibc(elf)) > NEWEST_GLIBC:
        found.append(f"needs glibc {newest[0]}.{newest[1]}")
    return found


def newest_glibc(elf: ELFFile) -> tuple[int, int]:
    """Newest version of glibc whose symbols are used."""
    section = elf.get_section_by_name(".gnu.version_r")
    names = [auxiliary.name for _, entries in section.iter_versions() for auxiliary in entries]
    versions = [match.groups() for name in names if (match := re.fullmatch(r"GLIBC_(\d+)\.(\d+).*", name))]
    return max(((int(major), int(minor)) for major, minor in versions), default=(0, 0))


def main() -> int:
    result = 0
    for path in map(Path, sys.argv[1:]):
        found = faults(path)
        print(f"{path.name}: {'; '.join(found) or 'good'}, {path.stat().st_size / 1e6:.1f} MB")
        result |= bool(found)
    return result


if __name__ == "__main__":
    sys.exit(main())
