"""Folders of generated files: what springline wrote there, whether it is stale, and what may be replaced.

``manifest.json`` lists every file of the folder with its SHA-256. A file may be replaced or removed only if
it is still as the manifest says, so nobody's work is ever overwritten unasked. Its ``kind`` says which command the
folder belongs to (that of generated C has none), and no other command touches what it lists.
"""

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path, PurePosixPath
from typing import Any, Literal, NamedTuple

from springline.codegen.files.atomic import change_folder, remove_leftovers
from springline.codegen.files.canonical import canonical_json

MANIFEST = "manifest.json"


class FolderConflict(Exception):
    """Files that springline did not write, or that were edited since, are in the way."""

    def __init__(self, folder: Path, reasons: Mapping[str, str], *, force_helps: bool) -> None:
        self.folder = folder
        self.paths = tuple(sorted(reasons))
        remedy = "move them away or choose another folder" + (", or use --force" if force_helps else "")
        lines = (f"  {path}: {reasons[path]}" for path in self.paths)
        super().__init__("\n".join([f"nothing was written to {folder}, for in the way are", *lines, remedy]))


class Stale(NamedTuple):
    """One difference between a folder and what would be written to it now.

    missing  is not there                      changed  is as it was written, but would be written differently
    extra    would no longer be written        edited   is not as it was written, nor as it would be
    """

    path: str
    kind: Literal["missing", "changed", "extra", "edited"]
    detail: str


class Changes(NamedTuple):
    """The paths that a write has written or removed; files that were right already are not touched."""

    written: tuple[str, ...]
    removed: tuple[str, ...]


def write_tree(
    folder: Path, files: Mapping[str, bytes], manifest: Mapping[str, object], *, force: bool = False
) -> Changes:
    """Make `folder` hold exactly `files` of those that springline writes, and a manifest that lists them.

    files     path inside the folder (``/`` between parts) -> content
    manifest  what the manifest says beside the list of files, which is added under ``files``; its ``kind``, if any,
              is that of the folder
    force     replace and remove edited and foreign files that are in the way too

    All or nothing: conflicts are looked for before anything is written, everything is prepared in a temporary
    folder, and if moving it into place fails then what was there is put back. Files that springline does not
    write stay where they are.

    Raises FolderConflict, ValueError for an impossible path, OSError if the disk refuses.
    """
    new = _with_manifest(files, manifest)
    listed = _listed(folder, manifest.get("kind"))
    removals = sorted(path for path in listed or {} if path not in new and _content(folder, path) is not None)
    _refuse_conflicts(folder, new, removals, listed, force=force)
    writes = [path for path, content in new.items() if _content(folder, path) != content]
    if writes or removals:
        change_folder(folder, {path: new[path] for path in writes}, removals)
    else:
        remove_leftovers(folder)
    return Changes(tuple(writes), tuple(removals))


def check_tree(folder: Path, files: Mapping[str, bytes], manifest: Mapping[str, object]) -> list[Stale]:
    """What ``write_tree`` with these arguments would find to change; empty if the folder is up to date.

    Writes nothing. Raises FolderConflict if the folder is of another kind, ValueError for an impossible path.
    """
    new = _with_manifest(files, manifest)
    listed = _listed(folder, manifest.get("kind")) or {}
    stale = []
    for path, content in new.items():
        old = _content(folder, path)
        if old == content:
            continue
        if old is None:
            stale.append(Stale(path, "missing", "is not there"))
        elif path == MANIFEST:
            stale.append(Stale(path, "changed", _manifest_difference(old, content)))
        elif _sha256(old) == listed.get(path):
            stale.append(Stale(path, "changed", _line_difference(old, content)))
        else:
            reason = "edited since it was written" if path in listed else "not written by springline"
            stale.append(Stale(path, "edited", reason))
    extra = (path for path in listed if path not in new and _content(folder, path) is not None)
    stale.extend(Stale(path, "extra", "would no longer be written") for path in extra)
    return sorted(stale)


def summary(folder: Path, stale: Sequence[Stale]) -> str:
    """What check_tree found, as text for a person: one line a file."""
    if not stale:
        return f"{folder} is up to date"
    lines = (f"  {entry.kind:8}{entry.path}: {entry.detail}" for entry in stale)
    return "\n".join([f"{folder} is stale:", *lines])


# --- what is there, and what may go ----------------------------------------------------------------------


def read_manifest(folder: Path, kind: object) -> dict[str, Any] | None:
    """The manifest of a folder of this kind; None if it has none, or one that springline did not write.

    Raises FolderConflict if the folder is of another kind: what its manifest lists would be taken for ours and removed.
    """
    content = _content(folder, MANIFEST)
    if content is None:
        return None
    try:
        manifest: dict[str, Any] = json.loads(content)
        listed = {entry["path"]: entry["sha256"] for entry in manifest["files"]}
    except (ValueError, KeyError, TypeError, RecursionError):
        return None
    # A manifest may come from elsewhere, and what it lists may be removed: no path of it leads outside.
    if not all(isinstance(path, str) and _stays_inside(path) for path in listed):
        return None
    if manifest.get("kind") != kind:
        raise FolderConflict(folder, {MANIFEST: "lists what another command wrote here"}, force_helps=False)
    return manifest


def _with_manifest(files: Mapping[str, bytes], manifest: Mapping[str, object]) -> dict[str, bytes]:
    """All files to write, sorted by path, the manifest last."""
    for path in files:
        if not _stays_inside(path) or path == MANIFEST:
            raise ValueError(f"{path!r} is no path for a generated file")
        for parent in PurePosixPath(path).parents:
            if str(parent) in files:
                raise ValueError(f"{str(parent)!r} cannot be a file and the folder of {path!r}")
    ordered = dict(sorted(files.items()))
    entries = [{"path": path, "sha256": _sha256(content)} for path, content in ordered.items()]
    return ordered | {MANIFEST: canonical_json({**manifest, "files": entries})}


def _listed(folder: Path, kind: object) -> dict[str, str] | None:
    """Path -> SHA-256 as the folder's manifest lists them; None if it has none of ours."""
    manifest = read_manifest(folder, kind)
    return None if manifest is None else {entry["path"]: entry["sha256"] for entry in manifest["files"]}


def _refuse_conflicts(
    folder: Path,
    new: Mapping[str, bytes],
    removals: Sequence[str],
    listed: Mapping[str, str] | None,
    *,
    force: bool,
) -> None:
    obstacles = {}  # no file: springline never removes folders or links, asked or not
    foreign = {}
    for path in (*new, *removals):
        obstacle = _obstacle(folder, path)
        old = _content(folder, path)
        if obstacle:
            obstacles[obstacle] = "is a link, or a folder where a file belongs, or the reverse"
        elif old is None or old == new.get(path):
            continue
        elif path == MANIFEST:
            if listed is None:
                foreign[path] = "not written by springline"
        elif path not in (listed or {}):
            foreign[path] = "not written by springline"
        elif listed and _sha256(old) != listed[path]:
            foreign[path] = "edited since springline wrote it"
    if obstacles:
        raise FolderConflict(folder, obstacles | foreign, force_helps=False)
    if foreign and not force:
        raise FolderConflict(folder, foreign, force_helps=True)


def _obstacle(folder: Path, path: str) -> str | None:
    """What keeps `path` from being a regular file below real folders, if anything does."""
    if folder.exists() and not folder.is_dir():
        return "."
    parts = PurePosixPath(path).parts
    for depth in range(1, len(parts) + 1):
        place = folder.joinpath(*parts[:depth])
        wanted = place.is_file() if depth == len(parts) else place.is_dir()
        if place.is_symlink() or (place.exists() and not wanted):
            return "/".join(parts[:depth])
    return None


def _content(folder: Path, path: str) -> bytes | None:
    place = folder / path
    return place.read_bytes() if place.is_file() else None


def _stays_inside(path: str) -> bool:
    pure = PurePosixPath(path)
    return str(pure) == path != "." and path.isprintable() and not pure.is_absolute() and ".." not in pure.parts


def _sha256(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


# --- words -----------------------------------------------------------------------------------------------


def _line_difference(old: bytes, new: bytes) -> str:
    """How many lines would come and go, counted as diff does: no order of the common lines keeps more of them."""
    old_lines, new_lines = old.splitlines(keepends=True), new.splitlines(keepends=True)
    kept = _longest_common(old_lines, new_lines)
    return f"{len(new_lines) - kept} of {len(new_lines)} lines are new, {len(old_lines) - kept} go"


def _longest_common(old: Sequence[bytes], new: Sequence[bytes]) -> int:
    """Length of the longest common subsequence.

    One bit a line of `old`, as in Hyyrö, "Bit-parallel LCS-length computations revisited" (2004): a table of thousands
    by thousands of lines would take seconds.
    """
    places: dict[bytes, int] = {}
    for k, line in enumerate(old):
        places[line] = places.get(line, 0) | 1 << k
    every = (1 << len(old)) - 1
    left = every
    for line in new:
        matched = left & places.get(line, 0)
        left = (left + matched | left - matched) & every
    return len(old) - left.bit_count()


def _manifest_difference(old: bytes, new: bytes) -> str:
    """Which entries of the manifest differ, named by keys and by the ``name`` of list items."""
    try:
        found = [text for text in _differences(json.loads(old), json.loads(new)) if text]
    except (ValueError, RecursionError):
        return "is no manifest"
    shown = found[:5] + ([f"and {len(found) - 5} more"] if len(found) > 5 else [])
    return "; ".join(shown) or "is written in another form"


def _differences(old: Any, new: Any, where: str = "") -> Iterator[str]:
    if old == new:
        return
    old, new = _by_name(old), _by_name(new)
    if isinstance(old, dict) and isinstance(new, dict):
        for key in sorted(old.keys() | new.keys()):
            if not where and key == "files":  # each stale file has a line of its own
                continue
            inner = f"{where}.{key}" if where else key
            if key not in old:
                yield f"{inner} is new"
            elif key not in new:
                yield f"{inner} is gone"
            else:
                yield from _differences(old[key], new[key], inner)
    else:
        old_text, new_text = json.dumps(old), json.dumps(new)
        short = len(old_text) + len(new_text) < 80
        yield f"{where} {old_text} -> {new_text}" if short else f"{where} differs"


def _by_name(value: Any) -> Any:
    if isinstance(value, list) and all(isinstance(item, dict) and isinstance(item.get("name"), str) for item in value):
        return {item["name"]: item for item in value}
    return value
