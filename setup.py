"""Which packages there are, and archives whose bytes depend on nothing but what is in them.

Packages are those found in the rooms, a new folder too. All else is in pyproject.toml.
"""

import gzip
import os
import tarfile
from pathlib import Path

from setuptools import find_packages, setup
from setuptools.command.bdist_wheel import bdist_wheel
from setuptools.command.sdist import sdist

FACE = "springline"
ROOMS = ("benchmarks", "codegen", "generated", "model", "runner")  # generated/ is data: no Python marks it as a package
# One time for every file. A release sets it to its commit's; 1980 is the first year that a wheel can express.
EPOCH = os.environ.setdefault("SOURCE_DATE_EPOCH", "315532800")


def plain(member: tarfile.TarInfo) -> tarfile.TarInfo:
    """A member of the sdist without its maker: no user, no time of the disk's, no umask."""
    member.uid = member.gid = 0
    member.uname = member.gname = ""
    member.mtime = int(EPOCH)
    member.mode = 0o755 if member.isdir() or member.mode & 0o100 else 0o644
    return member


class Sdist(sdist):
    """The sdist as a tar file that is the same wherever it is made."""

    def make_archive(self, base_name: str, format: str, root_dir=None, base_dir=None, owner=None, group=None) -> str:  # noqa: A002
        """Pack the folder `base_dir`; another format than gztar is packed as setuptools does."""
        if format != "gztar":
            return super().make_archive(base_name, format, root_dir, base_dir, owner, group)
        name = f"{base_name}.tar.gz"
        Path(name).parent.mkdir(parents=True, exist_ok=True)
        with (
            Path(name).open("wb") as file,
            gzip.GzipFile("", "wb", fileobj=file, mtime=int(EPOCH)) as packed,
            tarfile.open(fileobj=packed, mode="w", format=tarfile.PAX_FORMAT) as archive,
        ):
            archive.add(base_dir, filter=plain)  # in the order of names
        return name


class Wheel(bdist_wheel):
    """The wheel with the modes that an installation needs, whatever the umask."""

    def run(self) -> None:
        """Build it."""
        before = os.umask(0o022)
        try:
            super().run()
        finally:
            os.umask(before)


setup(
    cmdclass={"sdist": Sdist, "bdist_wheel": Wheel},
    package_dir={FACE: FACE, **{f"{FACE}.{room}": room for room in ROOMS}},
    packages=[
        FACE,
        *(f"{FACE}.{room}" for room in ROOMS),
        *(f"{FACE}.{room}.{package}" for room in ROOMS for package in find_packages(room)),
    ],
)
