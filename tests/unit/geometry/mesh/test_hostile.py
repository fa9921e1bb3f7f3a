"""Small files that would fill memory or time: read with the limits of a process, each is refused or a mesh."""

import json
import os
import struct
import subprocess
import sys

import pytest

resource = pytest.importorskip("resource", reason="limits of a process need a POSIX system")

MAX_MEMORY, MAX_CPU = 1 << 30, 20  # [B] beyond that of the program, [s]
READ = """
import resource, sys
from pathlib import Path
import numpy, trimesh
from skin_calib_addon.common.errors import InvalidMesh
from skin_calib_addon.geometry.mesh.triangle_mesh import read_mesh
used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (used + {memory},) * 2)
resource.setrlimit(resource.RLIMIT_CPU, ({cpu},) * 2)
for path in sorted(Path(sys.argv[1]).iterdir()):
    try:
        read_mesh(path)
    except InvalidMesh as problem:
        text = str(problem)
        assert "allocate" not in text and chr(10) not in text, (path.name, text)
    print(path.name)
"""
TRIANGLE = struct.pack("<9f", 0, 0, 0, 0.1, 0, 0, 0, 0.1, 0)
PLY = "ply\nformat binary_little_endian 1.0\nelement vertex {}\n" + "".join(f"property float {c}\n" for c in "xyz")
DAE = (
    '<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1"><asset><created>2020-01-01T00:00:00Z'
    "</created><modified>2020-01-01T00:00:00Z</modified></asset><library_visual_scenes>{}</library_visual_scenes>"
    '<scene><instance_visual_scene url="#s"/></scene></COLLADA>'
)


def glb(corners, count, nodes, view=0):
    """Return a binary glTF file with triangles at many nodes."""
    accessor = {"componentType": 5126, "count": count, "type": "VEC3"} | ({} if view is None else {"bufferView": view})
    document = {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": list(range(nodes))}],
        "nodes": [{"mesh": 0}] * nodes,
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [accessor],
        "bufferViews": [{"buffer": 0, "byteLength": len(corners)}],
        "buffers": [{"byteLength": len(corners)}],
    }
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    parts = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(corners), b"BIN\0") + corners
    return struct.pack("<4sII", b"glTF", 2, 12 + len(parts)) + parts


def corpus():
    """Return the files by name."""
    doubling = "".join(f'<node id="n{k}">{2 * f"""<instance_node url="#n{k - 1}"/>"""}</node>' for k in range(1, 60))
    return {
        "empty_accessor.glb": glb(TRIANGLE, 300_000_000, 1, view=None),
        "long_accessor.glb": glb(TRIANGLE, 300_000_000, 1),
        "nodes.glb": glb(TRIANGLE, 3, 100_000),
        "instances.glb": glb(TRIANGLE * 10_000, 30_000, 2_000),
        "doubling.dae": DAE.format(f'<visual_scene id="s"><node id="n0"/>{doubling}</visual_scene>').encode(),
        "entities.dae": b'<!DOCTYPE a [<!ENTITY a "b">]>' + DAE.format("").encode(),
        "deep.dae": DAE.format("<node>" * 100_000).encode(),
        "many_rows.ply": PLY.format(9_000_000_000).encode() + b"end_header\n",
        "long_list.ply": PLY.format(1).encode()
        + b"element face 1\nproperty list uint int vertex_indices\nend_header\n"
        + bytes(12)
        + b"\xff\xff\xff\x7f",
        "empty_lists.ply": PLY.format(1).encode()
        + b"element face 1000000\nproperty list uchar int vertex_indices\nend_header\n"
        + bytes(1_000_012),
        "announced.stl": bytes(80) + b"\xff\xff\xff\xff",
        "polygon.obj": b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf" + b" 1 2 3" * 500_000,
        "numbers.obj": b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 99999999999999999999\n",
        "rows.off": b"OFF\n3000000000 3000000000 0\n0 0 0\n",
        "digits.off": b"OFF\n" + b"9" * 1_000_000 + b" 1 0\n",
    }


@pytest.mark.skipif(not os.path.exists("/proc/self/statm"), reason="the memory of a process is not known here")
def test_no_small_file_fills_memory_or_time(tmp_path):
    """All of them in one process, with 1 GiB and 20 s."""
    files = corpus()
    for name, content in files.items():
        (tmp_path / name).write_bytes(content)
    program = READ.format(memory=MAX_MEMORY, cpu=MAX_CPU)
    call = [sys.executable, "-c", program, str(tmp_path)]
    done = subprocess.run(call, capture_output=True, text=True, env=os.environ | {"OPENBLAS_NUM_THREADS": "1"})
    assert done.returncode == 0, done.stderr[-1000:]
    assert done.stdout.split() == sorted(files)
