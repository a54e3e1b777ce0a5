"""Files of named tensors and a note, in the safetensors format, with a checksum over all of it."""

from __future__ import annotations

import hashlib
import reprlib
from collections.abc import Mapping

import torch
from torch import Tensor

from ..errors import InputError
from .files import parse_json


def packed(tensors: Mapping[str, Tensor], format: str, key: str, note: str) -> bytes:
    """The bytes of a file of this format: tensors on the CPU, and a text under its key."""
    from safetensors.torch import save

    # Clones, as the file format takes no two tensors that share memory.
    apart = {name: tensor.detach().contiguous().clone() for name, tensor in tensors.items()}
    return save(apart, metadata={"format": format, key: note, "sha256": digest(apart, note)})


def unpacked(data: bytes, format: str, key: str, source: str) -> tuple[dict[str, Tensor], str, str]:
    """The tensors, the note and the checksum in the bytes of such a file. Raises `InputError`, which begins with the
    source, on a file of another format and on any other content than was written."""
    from safetensors import SafetensorError
    from safetensors.torch import load

    try:
        tensors = load(data)
    except (SafetensorError, ValueError, KeyError) as error:
        raise InputError(f"{source} is damaged, or no safetensors file: {error}") from error
    header = parse_json(data[8:8 + int.from_bytes(data[:8], "little")], f"{source} is damaged: its header")
    notes = header.get("__metadata__") or {}
    if notes.get("format") != format:
        raise InputError(f"{source} must be of the format {format!r}, got {notes.get('format')!r}")
    note = notes.get(key, "")
    if digest(tensors, note) != notes.get("sha256"):
        raise InputError(f"{source} is damaged: its content does not give its checksum")
    return tensors, note, notes["sha256"]


def differences(found: Mapping[str, Tensor], expected: Mapping[str, Tensor]) -> list[str]:
    """Where named tensors differ from what is expected in name, shape or type, each in a few words."""
    return [f"{word(name)}: {_kind(found.get(name))}, expected {_kind(expected.get(name))}"
            for name in sorted({*found, *expected}) if _kind(found.get(name)) != _kind(expected.get(name))]


def word(name: str) -> str:
    """A name from a file, as it may be shown."""
    return name if name.isprintable() and len(name) < 40 else reprlib.repr(name)


def _kind(tensor: Tensor | None) -> str:
    if tensor is None:
        return "absent"
    kind = "" if tensor.dtype == torch.float32 else f" of {tensor.dtype}"
    return f"{'×'.join(map(str, tensor.shape)) or 'a number'}{kind}"


def digest(tensors: Mapping[str, Tensor], note: str) -> str:
    """SHA-256 of the note and of the names, types, shapes and values of the tensors."""
    found = hashlib.sha256(note.encode())
    for name in sorted(tensors):
        found.update(f"{name} {tensors[name].dtype} {tuple(tensors[name].shape)}".encode())
        found.update(tensors[name].contiguous().reshape(-1).view(torch.uint8).numpy().tobytes())
    return found.hexdigest()
