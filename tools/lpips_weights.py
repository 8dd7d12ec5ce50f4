#!/usr/bin/env python3
"""Turns the published weights of LPIPS v0.1 into the one safetensors file that ivv reads.

A trunk and its linear layers are needed, both for AlexNet or both for SqueezeNet 1.1:

  trunk    https://download.pytorch.org/models/alexnet-owt-7be5be79.pth       (torchvision, 233 MB)
           https://download.pytorch.org/models/squeezenet1_1-b8a52dc0.pth     (torchvision, 5 MB)
  linear   https://github.com/richzhang/PerceptualSimilarity, lpips/weights/v0.1/alex.pth or squeeze.pth

Only the convolutions and the linear layers are kept, as float32 under their published names. The files are read without
torch: of their pickles nothing but tensors is let through. Needs nothing but Python 3.8 or newer.
"""

import argparse
import array
import collections
import io
import json
import math
import os
import pickle
import struct
import sys
import zipfile

LEGACY_MAGIC = 0x1950A86A20F9469CFC6C
LEGACY_PROTOCOL = 1001


class BadInput(Exception):
    """An input that cannot be converted; the message says where and why."""


Storage = collections.namedtuple("Storage", "kind key count")
Tensor = collections.namedtuple("Tensor", "storage offset shape strides")


def rebuild_tensor(storage, offset, shape, strides, *_):
    return Tensor(storage, offset, tuple(shape), tuple(strides))


def rebuild_parameter(tensor, *_):
    return tensor


class Unpickler(pickle.Unpickler):
    """Lets a dictionary of tensors through and nothing that could run."""

    ALLOWED = {
        ("collections", "OrderedDict"): collections.OrderedDict,
        ("torch._utils", "_rebuild_tensor_v2"): rebuild_tensor,
        ("torch._utils", "_rebuild_parameter"): rebuild_parameter,
        ("torch", "FloatStorage"): "FloatStorage",
        ("torch", "LongStorage"): "LongStorage",
    }

    def find_class(self, module, name):
        try:
            return self.ALLOWED[module, name]
        except KeyError:
            raise BadInput(f"its pickle asks for {module}.{name}, which no file of weights needs") from None

    def persistent_load(self, identity):
        tag, kind, key, _, count = identity[:5]
        if tag != "storage":
            raise BadInput(f"its pickle refers to a {tag!r}")
        return Storage(kind, str(key), count)


def read_zip(data):
    """(tensors, function from a storage to its bytes) of a file of torch 1.6 or newer."""
    archive = zipfile.ZipFile(io.BytesIO(data))
    roots = [name[: -len("data.pkl")] for name in archive.namelist() if name.endswith("data.pkl")]
    if len(roots) != 1:
        raise BadInput("is an archive without data.pkl")
    root = roots[0]
    if root + "byteorder" in archive.namelist() and archive.read(root + "byteorder") != b"little":
        raise BadInput("is big-endian")
    tensors = Unpickler(io.BytesIO(archive.read(root + "data.pkl"))).load()
    return tensors, lambda storage: archive.read(f"{root}data/{storage.key}")


def read_legacy(data):
    """(tensors, function from a storage to its bytes) of a file of torch before 1.6."""
    file = io.BytesIO(data)
    magic, protocol, system = (Unpickler(file).load() for _ in range(3))
    if (magic, protocol) != (LEGACY_MAGIC, LEGACY_PROTOCOL) or not system.get("little_endian"):
        raise BadInput("is no little-endian file of torch")
    tensors, keys = (Unpickler(file).load() for _ in range(2))
    widths = {"FloatStorage": 4, "LongStorage": 8}
    kinds = {t.storage.key: t.storage.kind for t in tensors.values() if isinstance(t, Tensor)}
    places, at = {}, file.tell()
    for key in map(str, keys):
        (count,) = struct.unpack_from("<q", data, at)
        size = count * widths[kinds[key]]
        if count < 0 or at + 8 + size > len(data):
            raise BadInput(f"ends before the {count} values of storage {key}")
        places[key] = slice(at + 8, at + 8 + size)
        at += 8 + size
    return tensors, lambda storage: data[places[storage.key]]


def read_pth(path):
    """The float32 tensors of a .pth by name, as (shape, little-endian bytes), each decoded when it is asked for."""
    with open(path, "rb") as file:
        data = file.read()
    try:
        tensors, stored = (read_zip if data[:2] == b"PK" else read_legacy)(data)
        tensors = {name: tensor for name, tensor in tensors.items() if isinstance(tensor, Tensor)}
    except BadInput:
        raise
    # A damaged pickle fails in any of these ways.
    except (pickle.UnpicklingError, zipfile.BadZipFile, struct.error, AttributeError, EOFError, LookupError,
            TypeError, ValueError) as cause:
        raise BadInput(f"is no file of torch ({type(cause).__name__}: {cause})") from None
    return {name: lambda tensor=tensor, name=name: values(name, tensor, stored) for name, tensor in tensors.items()}


def values(name, tensor, stored):
    """(shape, little-endian float32 bytes) of a tensor."""
    strides, step = [], 1
    for extent in reversed(tensor.shape):
        strides.insert(0, step)
        step *= extent
    if tensor.storage.kind != "FloatStorage" or tensor.strides != tuple(strides):
        raise BadInput(f"tensor `{name}`: expected float32 in row-major order")
    data = bytes(stored(tensor.storage))[4 * tensor.offset : 4 * (tensor.offset + step)]
    if len(data) != 4 * step:
        raise BadInput(f"tensor `{name}`: {len(data)} bytes, its shape {tensor.shape} needs {4 * step}")
    return tensor.shape, data


def conv(name, outputs, inputs, kernel):
    return {f"{name}.weight": (outputs, inputs, kernel, kernel), f"{name}.bias": (outputs,)}


def fire(name, inputs, squeeze, expand):
    return {
        **conv(f"{name}.squeeze", squeeze, inputs, 1),
        **conv(f"{name}.expand1x1", expand, squeeze, 1),
        **conv(f"{name}.expand3x3", expand, squeeze, 3),
    }


TRUNKS = {
    "alexnet": {
        **conv("0", 64, 3, 11),
        **conv("3", 192, 64, 5),
        **conv("6", 384, 192, 3),
        **conv("8", 256, 384, 3),
        **conv("10", 256, 256, 3),
    },
    "squeezenet1_1": {
        **conv("0", 64, 3, 3),
        **fire("3", 64, 16, 64),
        **fire("4", 128, 16, 64),
        **fire("6", 128, 32, 128),
        **fire("7", 256, 32, 128),
        **fire("9", 256, 48, 192),
        **fire("10", 384, 48, 192),
        **fire("11", 384, 64, 256),
        **fire("12", 512, 64, 256),
    },
}
TAPS = {"alexnet": (64, 192, 384, 256, 256), "squeezenet1_1": (64, 128, 256, 384, 384, 512, 512)}


def take(path, tensors, prefixes, shapes):
    """The tensors of `shapes` under their names below one of `prefixes`."""
    taken = {}
    for name, shape in shapes.items():
        found = next((tensors[prefix + name] for prefix in prefixes if prefix + name in tensors), None)
        if found is None:
            raise BadInput(f"{path}: tensor `{prefixes[0]}{name}` is missing")
        try:
            actual, data = found()
        except BadInput as fault:
            raise BadInput(f"{path}: {fault}") from None
        if actual != shape:
            raise BadInput(f"{path}: tensor `{prefixes[0]}{name}` has the shape {actual}, expected {shape}")
        floats = array.array("f", data)
        if sys.byteorder == "big":
            floats.byteswap()
        if not all(map(math.isfinite, floats)):
            raise BadInput(f"{path}: tensor `{prefixes[0]}{name}` holds values that are not finite")
        taken[prefixes[0] + name] = (shape, data)
    return taken


def safetensors(tensors, trunk):
    """The bytes of a safetensors file."""
    header, at = {"__metadata__": {"lpips": "0.1", "trunk": trunk}}, 0
    for name, (shape, data) in tensors.items():
        header[name] = {"dtype": "F32", "shape": shape, "data_offsets": [at, at + len(data)]}
        at += len(data)
    text = json.dumps(header, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 8)
    return struct.pack("<Q", len(text)) + text + b"".join(data for _, data in tensors.values())


def convert(trunk_path, linear_path):
    """The bytes of the safetensors file."""
    loaded = []
    for path in (trunk_path, linear_path):
        try:
            loaded.append(read_pth(path))
        except BadInput as fault:
            raise BadInput(f"{path}: {fault}") from None
    trunk_tensors, linear_tensors = loaded
    # Some copies of a trunk leave the prefix out.
    prefixes = ("features.", "")
    is_squeezenet = any(prefix + "3.squeeze.weight" in trunk_tensors for prefix in prefixes)
    trunk = "squeezenet1_1" if is_squeezenet else "alexnet"
    linear = {f"lin{k}.model.1.weight": (1, channels, 1, 1) for k, channels in enumerate(TAPS[trunk])}
    tensors = take(trunk_path, trunk_tensors, prefixes, TRUNKS[trunk])
    tensors.update(take(linear_path, linear_tensors, ("",), linear))
    return safetensors(tensors, trunk)


def write_atomic(path, data):
    """Writes bytes so that `path` never holds half of them."""
    temporary = f"{path}.{os.getpid()}.tmp"
    try:
        with open(temporary, "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, path)
    except BaseException:
        if os.path.exists(temporary):
            os.remove(temporary)
        raise


def main(arguments=None):
    """The command line; returns the exit code (0 done, 2 usage, 3 bad data)."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("trunk", help="torchvision's .pth")
    parser.add_argument("linear", help="the .pth of LPIPS v0.1")
    parser.add_argument("output", help="the safetensors file to write")
    options = parser.parse_args(arguments)
    try:
        write_atomic(options.output, convert(options.trunk, options.linear))
    except (BadInput, OSError) as fault:
        print(f"lpips_weights: {fault}", file=sys.stderr)
        return 3
    return 0


if __name__ == "__main__":
    sys.exit(main())
